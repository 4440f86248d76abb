//! A simulated Kinect on a moving robot: scenes whose truth is known, and the messages a driver would publish.
//!
//! Pure and fixed by its seed: no clock, no thread, no I/O, and a generator whose algorithm has a name, so that an
//! update of a dependency changes no recording. Lengths are metres, angles radians, times seconds.
//!
//! One way: [`Scene`] (what there is) -> [`Kinect`] (what is measured of it) -> [`Drive`] (what a driver sends), with
//! [`Robot`] telling where the Kinect is.

pub mod drive;
pub mod kinect;
pub mod path;
mod raycast;
pub mod robot;
mod room;
pub mod scene;

pub use drive::{Drive, Step};
pub use kinect::{DepthImage, Kinect};
pub use path::{Path, Route};
pub use robot::Robot;
pub use scene::{Hit, Rectangle, Scene};
