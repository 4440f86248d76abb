//! Wire types.

/// ROS packages.
pub mod ros;
