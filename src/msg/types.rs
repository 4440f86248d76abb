//! Names of the types that are read, in one table: they are the same over any middleware and in a bag.

/// Clouds.
pub const CLOUD: &str = "sensor_msgs/msg/PointCloud2";
/// Depth images.
pub const IMAGE: &str = "sensor_msgs/msg/Image";
/// Depth images as PNG.
pub const COMPRESSED_IMAGE: &str = "sensor_msgs/msg/CompressedImage";
/// What `image_transport` appends to the name of depth images for these.
pub const COMPRESSED_DEPTH: &str = "/compressedDepth";
/// The intrinsics of depth images.
pub const CAMERA_INFO: &str = "sensor_msgs/msg/CameraInfo";
/// Transforms, changing or lasting.
pub const TRANSFORMS: &str = "tf2_msgs/msg/TFMessage";
/// The simulated time.
pub const CLOCK: &str = "rosgraph_msgs/msg/Clock";
