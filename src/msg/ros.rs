//! Wire types of the ROS packages that the node speaks, field for field in the order of their `.msg` files.
//!
//! Serialised as CDR by serde; units and meanings are those of the packages named at each type.

use serde::{Deserialize, Deserializer, Serialize};

use crate::engine::Stamp;

/// `builtin_interfaces/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds since the Unix epoch.
    pub sec: i32,
    /// Nanoseconds, below 1e9.
    pub nanosec: u32,
}

impl Time {
    /// The stamp that this time stands for, or `None` where `nanosec` is 1e9 or more.
    pub fn stamp(self) -> Option<Stamp> {
        (self.nanosec < 1_000_000_000)
            .then(|| Stamp::from_nanos(i64::from(self.sec) * 1_000_000_000 + i64::from(self.nanosec)))
    }
}

impl From<Stamp> for Time {
    /// Saturates at the ends of the 32-bit second.
    fn from(stamp: Stamp) -> Self {
        let sec = stamp.nanos().div_euclid(1_000_000_000);
        let nanosec = stamp.nanos().rem_euclid(1_000_000_000) as u32;
        i32::try_from(sec).map_or_else(
            |_| if sec < 0 { Self { sec: i32::MIN, nanosec: 0 } } else { Self { sec: i32::MAX, nanosec } },
            |sec| Self { sec, nanosec },
        )
    }
}

/// `builtin_interfaces/Duration`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Duration {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds, below 1e9.
    pub nanosec: u32,
}

/// Longest name of a frame that is taken (bytes): names are kept, and a sender can make up ever new ones.
pub const MAX_FRAME_ID_BYTES: usize = 256;

/// The name of a frame without leading slashes: ROS 1 put one, tf2 takes none. They are taken off where a name comes in, with a
/// message or as a parameter, so that whoever compares names need not think of them.
pub(crate) fn bare(name: &str) -> &str {
    name.trim_start_matches('/')
}

/// Reads the name of a frame.
fn frame_name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let mut name = String::deserialize(deserializer)?;
    name.drain(..name.len() - bare(&name).len());
    Ok(name)
}

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Time of acquisition.
    pub stamp: Time,
    /// Coordinate frame of the data; as it is read, without leading slashes.
    #[serde(deserialize_with = "frame_name")]
    pub frame_id: String,
}

/// `std_msgs/ColorRGBA`, each 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct ColorRgba {
    pub r: f32,
    pub g: f32,
    pub b: f32,
    pub a: f32,
}

/// `geometry_msgs/Vector3`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// `geometry_msgs/Point`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct Point {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// `geometry_msgs/Point32`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct Point32 {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

/// `geometry_msgs/Quaternion`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct Quaternion {
    pub x: f64,
    pub y: f64,
    pub z: f64,
    pub w: f64,
}

impl Default for Quaternion {
    /// No rotation.
    fn default() -> Self {
        Self { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }
    }
}

/// `geometry_msgs/Pose`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct Pose {
    pub position: Point,
    pub orientation: Quaternion,
}

/// `geometry_msgs/Transform`: maps child coordinates into the parent frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct Transform {
    pub translation: Vector3,
    pub rotation: Quaternion,
}

/// `geometry_msgs/TransformStamped`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped {
    /// Stamp and parent frame.
    pub header: Header,
    /// Child frame; as it is read, without leading slashes.
    #[serde(deserialize_with = "frame_name")]
    pub child_frame_id: String,
    /// Maps child coordinates into the parent frame.
    pub transform: Transform,
}

/// `tf2_msgs/TFMessage`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TfMessage {
    /// The transforms.
    pub transforms: Vec<TransformStamped>,
}

/// `geometry_msgs/Polygon`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Polygon {
    /// Vertices; the last one joins the first.
    pub points: Vec<Point32>,
}

/// `shape_msgs/Plane`: a x + b y + c z + d = 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    /// [a, b, c, d].
    pub coef: [f64; 4],
}

/// `sensor_msgs/PointField`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointField {
    /// Name of the field.
    pub name: String,
    /// Bytes from the start of a point.
    pub offset: u32,
    /// One of the `datatype` constants of `sensor_msgs/PointField`.
    pub datatype: u8,
    /// Number of elements.
    pub count: u32,
}

impl PointField {
    /// `sensor_msgs/PointField` datatype of a `u32`.
    pub const UINT32: u8 = 6;
    /// `sensor_msgs/PointField` datatype of an `f32`.
    pub const FLOAT32: u8 = 7;
    /// `sensor_msgs/PointField` datatype of an `f64`.
    pub const FLOAT64: u8 = 8;

    /// A field of one element.
    pub fn single(name: &str, offset: u32, datatype: u8) -> Self {
        Self { name: name.to_owned(), offset, datatype, count: 1 }
    }
}

/// `sensor_msgs/PointCloud2`, owned; incoming clouds are decoded without this copy by [`crate::cloud`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointCloud2 {
    /// Stamp and frame.
    pub header: Header,
    /// Rows; 1 for an unordered cloud.
    pub height: u32,
    /// Points in a row.
    pub width: u32,
    /// Layout of a point.
    pub fields: Vec<PointField>,
    /// Byte order of the data.
    pub is_bigendian: bool,
    /// Bytes of a point.
    pub point_step: u32,
    /// Bytes of a row.
    pub row_step: u32,
    /// The points.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
    /// The sender's claim that all points are finite; not relied on.
    #[serde(rename = "is_dense")]
    pub all_finite: bool,
}

/// `sensor_msgs/Image`, owned; incoming depth images are decoded without this copy by [`crate::cloud`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Image {
    /// Stamp and frame.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Pixels in a row.
    pub width: u32,
    /// What a pixel is, a name of `sensor_msgs/image_encodings.hpp`.
    pub encoding: String,
    /// Byte order of the data: 0 = little-endian.
    pub is_bigendian: u8,
    /// Bytes of a row.
    pub step: u32,
    /// The pixels.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// `sensor_msgs/CompressedImage`, owned: a depth image that comes in, and empty within a [`Marker`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompressedImage {
    /// Stamp and frame.
    pub header: Header,
    /// Encoding and compression, as `16UC1; compressedDepth png`.
    pub format: String,
    /// The compressed image.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// `sensor_msgs/RegionOfInterest`, in pixels of the full resolution; all 0 = the whole image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// Leftmost column.
    pub x_offset: u32,
    /// Topmost row.
    pub y_offset: u32,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Whether the region is to be rectified.
    pub do_rectify: bool,
}

/// `sensor_msgs/CameraInfo`; matrices are row-major.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo {
    /// Stamp and frame of the image it belongs to.
    pub header: Header,
    /// Rows at full resolution.
    pub height: u32,
    /// Columns at full resolution.
    pub width: u32,
    /// Name of the model of lens distortion.
    pub distortion_model: String,
    /// Its coefficients.
    pub d: Vec<f64>,
    /// 3x3, of the raw image.
    pub k: [f64; 9],
    /// 3x3 rotation of a stereo camera's rectification.
    pub r: [f64; 9],
    /// 3x4, of the rectified image.
    pub p: [f64; 12],
    /// Columns combined to one; 0 = 1.
    pub binning_x: u32,
    /// Rows combined to one; 0 = 1.
    pub binning_y: u32,
    /// The part of the image that is sent, before binning.
    pub roi: RegionOfInterest,
}

/// `visualization_msgs/Marker`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are those of visualization_msgs/Marker")]
pub struct Marker {
    pub header: Header,
    pub ns: String,
    pub id: i32,
    #[serde(rename = "type")]
    pub kind: i32,
    pub action: i32,
    pub pose: Pose,
    pub scale: Vector3,
    pub color: ColorRgba,
    pub lifetime: Duration,
    pub frame_locked: bool,
    pub points: Vec<Point>,
    pub colors: Vec<ColorRgba>,
    pub texture_resource: String,
    pub texture: CompressedImage,
    pub uv_coordinates: Vec<UvCoordinate>,
    pub text: String,
    pub mesh_resource: String,
    pub mesh_file: MeshFile,
    pub mesh_use_embedded_materials: bool,
}

impl Marker {
    /// `type` of a list of line segments.
    pub const LINE_LIST: i32 = 5;
    /// `type` of a list of cubes.
    pub const CUBE_LIST: i32 = 6;
    /// `type` of a list of triangles, three points each.
    pub const TRIANGLE_LIST: i32 = 11;
    /// `type` of a text that faces the viewer.
    pub const TEXT_VIEW_FACING: i32 = 9;
    /// `action` that adds or modifies.
    pub const ADD: i32 = 0;
    /// `action` that deletes one marker.
    pub const DELETE: i32 = 2;
    /// `action` that deletes all markers.
    pub const DELETEALL: i32 = 3;
}

/// `visualization_msgs/UVCoordinate`; never sent here.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "never filled")]
pub struct UvCoordinate {
    pub u: f32,
    pub v: f32,
}

/// `visualization_msgs/MeshFile`; always empty here.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "never filled")]
pub struct MeshFile {
    pub filename: String,
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// `visualization_msgs/MarkerArray`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// The markers.
    pub markers: Vec<Marker>,
}

/// `rosgraph_msgs/Clock`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// The simulated time.
    pub clock: Time,
}

/// Request of `std_srvs/Trigger`; ROS gives an empty struct one byte.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriggerRequest {
    /// Always 0.
    pub structure_needs_at_least_one_member: u8,
}

/// Response of `std_srvs/Trigger`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// Whether it was done.
    pub success: bool,
    /// What was done, or why not.
    pub message: String,
}

#[cfg(test)]
mod tests {
    use byteorder::LittleEndian;

    use super::*;

    #[test]
    fn names_of_frames_are_read_without_leading_slashes() {
        let read = |parent: &str, child: &str| {
            let header = Header { frame_id: parent.to_owned(), ..Header::default() };
            let child_frame_id = child.to_owned();
            let sent = TransformStamped { header, child_frame_id, ..TransformStamped::default() };
            let bytes = cdr_encoding::to_vec::<_, LittleEndian>(&sent).unwrap();
            let (read, _) = cdr_encoding::from_bytes::<TransformStamped, LittleEndian>(&bytes).unwrap();
            (read.header.frame_id, read.child_frame_id)
        };
        let names = |parent: &str, child: &str| (parent.to_owned(), child.to_owned());
        assert_eq!(read("/map", "//robot/camera"), names("map", "robot/camera"));
        assert_eq!(read("odom", "/"), names("odom", ""));
    }
}
