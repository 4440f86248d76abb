//! The incremental grid-and-cluster engine.
//!
//! [`paper`] is the method to the letter. [`Engine`] is the one that a session works with, as [`Params::mode`] says.
//! Everything here is pure: no ROS, no async, no I/O, no clock, no thread; the same scans give the same
//! map, whatever the order of the points within a scan.
//!
//! Its cost follows the points of the scan, the voxels it touched and the outlines of the clusters that it changed, not the size of
//! the map, but in mode `consistent` for lists that a frozen map shares, and for a look at the keys of all blocks where the view is
//! wider than the map.
//!
//! ```
//! use cfodi::engine::{Engine, Isometry3, Params, Points, Scan, Stamp};
//!
//! // A floor of 2 x 2 m, one point each centimetre, seen from 1 m above.
//! let points = (0..40_000).map(|i| [(i % 200) as f32 * 0.01 + 0.001, (i / 200) as f32 * 0.01 + 0.001, -0.99]).collect();
//! let scan = Scan {
//!     stamp: Stamp::from_nanos(1),
//!     fixed_from_sensor: Isometry3::translation(0.0, 0.0, 1.0),
//!     points: Points::F32(points),
//! };
//! let mut engine = Engine::new(Params::default());
//! let update = engine.insert(&scan);
//! assert_eq!(update.changed.len(), 1);
//! let floor = &engine.snapshot().clusters[0];
//! assert!(floor.normal.z > 0.999 && floor.voxel_count == 625);
//! ```

pub(crate) mod arch;
pub(crate) mod binning;
mod class;
pub mod consistent;
mod frozen;
mod key;
mod map;
mod now;
pub mod paper;
mod params;
pub(crate) mod plane;
mod points;
mod rectangle;
mod saved;
mod scan;
mod snapshot;
mod step;
mod symmetric;

#[cfg(test)]
pub(crate) use binning::between;
pub use class::SurfaceClass;
pub use consistent::NoiseModel;
pub use frozen::Frozen;
pub use key::{ClusterId, GRID_REACH, Partition, VoxelKey, canonical};
pub use map::Engine;
pub use nalgebra::Isometry3;
pub(crate) use params::{
    DEPTH, EXPANSION_INTERVAL, KEEP_RADIUS, MAX_NORMAL_ANGLE, MAX_VOXELS, MIN_POINTS, MIN_VICINITY,
    POSE_SIGMA, VOXEL_SIZE,
};
pub use params::{Mode, Params, ParamsError};
pub use points::{Depths, Points, Rays};
pub use saved::{RestoreError, SavedMap};
pub use scan::{JUMP_BACK, Scan, Stamp};
pub use snapshot::{ChangedCluster, Cluster, ClusterState, DenseVoxel, Snapshot, Update};
pub use step::PipelineStep;

/// Clusters with fewer voxels are [`ClusterState::Tentative`] in [`Mode::Paper`]; in `consistent` the bound is 20.
pub const MIN_RELIABLE_VOXELS: u32 = 10;
