//! The incremental grid-and-cluster engine of the paper; pure: no ROS, async, I/O, clock or thread.

/// Types.
pub mod key;
/// Types.
pub mod scan;
/// Types.
pub mod snapshot;
pub use key::{ClusterId, VoxelKey};
pub use scan::{Points, Scan, Stamp};
pub use snapshot::{ChangedCluster, Cluster, ClusterState, DenseVoxel, Snapshot, Update};
/// Clusters with fewer voxels are TENTATIVE.
pub const MIN_RELIABLE_VOXELS: u32 = 10;
