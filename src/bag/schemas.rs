//! Definitions of the messages that a result bag holds, in the form `ros2msg`: a type's fields, then those of each type it
//! is made of, so that a reader needs nothing installed.

use std::collections::BTreeSet;

/// Fields of the ROS packages' types, as their `.msg` files have them.
const DEFINITIONS: &[(&str, &str)] = &[
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/Duration", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("std_msgs/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Point32", "float32 x\nfloat32 y\nfloat32 z\n"),
    ("geometry_msgs/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    ("geometry_msgs/Polygon", "geometry_msgs/Point32[] points\n"),
    ("geometry_msgs/PolygonInstance", "geometry_msgs/Polygon polygon\nint64 id\n"),
    (
        "geometry_msgs/PolygonInstanceStamped",
        "std_msgs/Header header\ngeometry_msgs/PolygonInstance polygon\n",
    ),
    ("geometry_msgs/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    ("tf2_msgs/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    ("shape_msgs/Plane", "float64[4] coef\n"),
    (
        "sensor_msgs/PointField",
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n\
         uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n",
    ),
    (
        "sensor_msgs/PointCloud2",
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n\
         uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
    ),
    ("sensor_msgs/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"),
    (
        "sensor_msgs/RegionOfInterest",
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n",
    ),
    (
        "sensor_msgs/CameraInfo",
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n\
         float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
    ),
    ("visualization_msgs/UVCoordinate", "float32 u\nfloat32 v\n"),
    ("visualization_msgs/MeshFile", "string filename\nuint8[] data\n"),
    (
        "visualization_msgs/Marker",
        "int32 ARROW=0\nint32 CUBE=1\nint32 SPHERE=2\nint32 CYLINDER=3\nint32 LINE_STRIP=4\nint32 LINE_LIST=5\n\
         int32 CUBE_LIST=6\nint32 SPHERE_LIST=7\nint32 POINTS=8\nint32 TEXT_VIEW_FACING=9\nint32 MESH_RESOURCE=10\n\
         int32 TRIANGLE_LIST=11\nint32 ARROW_STRIP=12\nint32 ADD=0\nint32 MODIFY=0\nint32 DELETE=2\nint32 DELETEALL=3\n\
         std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
         geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n\
         bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring texture_resource\n\
         sensor_msgs/CompressedImage texture\nvisualization_msgs/UVCoordinate[] uv_coordinates\nstring text\n\
         string mesh_resource\nvisualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n",
    ),
    ("visualization_msgs/MarkerArray", "visualization_msgs/Marker[] markers\n"),
    ("vision_msgs/ObjectHypothesis", "string class_id\nfloat64 score\n"),
    (
        "vision_msgs/ObjectHypothesisWithPose",
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n",
    ),
    ("vision_msgs/BoundingBox3D", "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n"),
    (
        "vision_msgs/Detection3D",
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\n\
         string id\n",
    ),
    ("vision_msgs/Detection3DArray", "std_msgs/Header header\nvision_msgs/Detection3D[] detections\n"),
    ("diagnostic_msgs/KeyValue", "string key\nstring value\n"),
    (
        "diagnostic_msgs/DiagnosticStatus",
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\nstring message\nstring hardware_id\n\
         diagnostic_msgs/KeyValue[] values\n",
    ),
    (
        "diagnostic_msgs/DiagnosticArray",
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
    ),
    ("cfodi_msgs/SurfaceCluster", include_str!("../../msg/SurfaceCluster.msg")),
    ("cfodi_msgs/SurfaceClusterArray", include_str!("../../msg/SurfaceClusterArray.msg")),
];

/// The full definition of a type named as in `sensor_msgs/msg/PointCloud2`; `None` for one that no result bag holds.
pub(super) fn definition(type_name: &str) -> Option<String> {
    let root = type_name.replacen("/msg/", "/", 1);
    let mut text = fields(&root)?.to_owned();
    let (mut seen, mut open) = (BTreeSet::from([root.clone()]), parts(&root));
    while let Some(part) = open.pop() {
        if seen.insert(part.clone()) {
            let line = "=".repeat(80);
            text.extend([&line, "\nMSG: ", &part, "\n", fields(&part)?]);
            open.extend(parts(&part));
        }
    }
    Some(text)
}

fn fields(name: &str) -> Option<&'static str> {
    DEFINITIONS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// The types that a type's fields have, other than numbers and texts; those of its own package may lack its name.
fn parts(name: &str) -> Vec<String> {
    let package = name.split('/').next().unwrap_or_default();
    let lines = fields(name).unwrap_or_default().lines();
    let types = lines.filter_map(|line| line.split('#').next()?.split_whitespace().next());
    let types = types.map(|field| field.split('[').next().unwrap_or(field).to_owned());
    let compound = types.filter(|field| field.contains('/') || field.starts_with(char::is_uppercase));
    compound
        .map(|field| if field.contains('/') { field } else { format!("{package}/{field}") })
        .rev()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_definition_holds_every_type_it_is_made_of_once() {
        let text = definition("cfodi_msgs/msg/SurfaceClusterArray").unwrap();
        let messages: Vec<_> = text.lines().filter_map(|line| line.strip_prefix("MSG: ")).collect();
        let expected = [
            "std_msgs/Header",
            "builtin_interfaces/Time",
            "cfodi_msgs/SurfaceCluster",
            "shape_msgs/Plane",
            "geometry_msgs/Pose",
            "geometry_msgs/Point",
            "geometry_msgs/Quaternion",
            "geometry_msgs/Vector3",
            "geometry_msgs/Polygon",
            "geometry_msgs/Point32",
        ];
        assert_eq!(messages, expected);
    }

    #[test]
    fn every_type_can_be_resolved() {
        for (name, _) in DEFINITIONS {
            assert!(definition(name).is_some(), "{name}");
        }
        assert_eq!(definition("sensor_msgs/msg/Imu"), None);
    }
}
