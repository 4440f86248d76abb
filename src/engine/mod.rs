//! The incremental grid-and-cluster engine: the paper, in its own order.
//!
//! Scan → grid → normals → partial clusters → global clusters. The modules stand in that order; [`Engine::insert`] is
//! the pipeline. Everything here is pure: no ROS, no async, no I/O, no clock, no thread; the same scans give the same
//! map, whatever the order of the points within a scan.
//!
//! What is always true after [`Engine::insert`]: every dense voxel with a normal belongs to exactly one global cluster;
//! the sums of a cluster are exactly those over its voxels' centres; ids count up and are never used again.
//! Its cost follows the points of the scan and the voxels it touched, never the size of the map.
//!
//! Beside it stand [`statics`], the paper's baseline that re-clusters everything, and [`oracle`], a slow and plain
//! version of the same definitions that shares types with the engine and no function.
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

mod describe;
mod extremes;
mod globals;
mod grid;
mod key;
mod moments;
mod neighbourhood;
mod normals;
pub mod oracle;
mod params;
mod partial;
mod pipeline;
mod plane;
pub mod rand_index;
mod rectangle;
mod scan;
mod snapshot;
pub mod statics;
mod step;

pub use key::{ClusterId, DIRECTIONS, GRID_REACH, VoxelKey};
pub use nalgebra::Isometry3;
pub use params::{Params, ParamsError};
pub use pipeline::Engine;
pub use scan::{Points, Scan, Stamp};
pub use snapshot::{ChangedCluster, Cluster, ClusterState, DenseVoxel, Snapshot, Update};
pub use step::PipelineStep;

/// Clusters with fewer voxels are [`ClusterState::Tentative`].
pub const MIN_RELIABLE_VOXELS: u32 = 10;
