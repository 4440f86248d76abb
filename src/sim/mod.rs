//! A simulated Kinect on a moving robot: scenes whose truth is known, and the messages a driver would publish.
//!
//! Pure and fixed by its seed: no clock, no thread, no I/O, and a generator whose algorithm has a name, so that an
//! update of a dependency changes no recording. Lengths are metres, angles radians, times seconds.
//!
//! One way: [`Scene`] (what there is) -> [`Kinect`] (what is measured of it) -> [`Drive`] (what a driver sends), with
//! [`Robot`] telling where the Kinect is. Each [`Surface`] has a label, a name and a class; every point is given with
//! the label of the surface it was measured on, and [`SeenCells`] tells which parts of a surface were to be seen.

pub mod drive;
pub mod kinect;
pub mod motion;
pub(crate) mod noise;
mod parts;
pub mod path;
#[cfg(test)]
mod plain;
mod pose_noise;
mod raycast;
pub mod robot;
pub mod scene;
mod scenes;
pub mod seen;
pub mod surface;

pub use drive::{Drive, LabelledScan, Step};
pub use kinect::{DepthImage, Kinect};
pub use motion::Motion;
pub use path::{Path, Route};
pub use pose_noise::{PoseNoise, PoseSpread};
pub use robot::Robot;
pub use scene::Scene;
pub use seen::SeenCells;
pub use surface::{Hole, Shape, Surface};
