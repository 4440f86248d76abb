"""Bytes of whole messages as real ROS 2 writes them: the Rust wire types are held against these.

`bash tests/ros/python.sh tests/ros/golden.py` writes tests/golden/*.cdr and the table of their values again. Integers
are whole and floats end in .5, so that no number fits the wrong type, and no two neighbours are alike.
"""

import pathlib
import re

from builtin_interfaces.msg import Duration, Time
from cfodi_msgs.msg import SurfaceCluster, SurfaceClusterArray
from geometry_msgs.msg import (Point, Point32, Polygon, PolygonInstance, PolygonInstanceStamped, Pose, PoseWithCovariance,
                               Quaternion, Transform, TransformStamped, Vector3)
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2, PointField, RegionOfInterest
from shape_msgs.msg import Plane
from std_msgs.msg import ColorRGBA, Header
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import BoundingBox3D, Detection3D, Detection3DArray, ObjectHypothesis, ObjectHypothesisWithPose
from visualization_msgs.msg import Marker, MarkerArray, UVCoordinate

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "golden"


def floats(first, count):
    """`count` floats from `first` + 0.5 on, one apart."""
    return [first + i + 0.5 for i in range(count)]


def header(first, frame_id):
    return Header(stamp=Time(sec=first, nanosec=first + 1), frame_id=frame_id)


def polygon(first):
    xyz = floats(first, 9)
    return Polygon(points=[Point32(x=xyz[i], y=xyz[i + 1], z=xyz[i + 2]) for i in (0, 3, 6)])


def pose(first):
    x, y, z, qx, qy, qz, qw = floats(first, 7)
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def vector(first, kind=Vector3):
    x, y, z = floats(first, 3)
    return kind(x=x, y=y, z=z)


def cluster(n):
    b = 100 * n
    return SurfaceCluster(
        id=b + 1, revision=b + 2, state=n, surface_class=n + 2, class_confidence=n / 4, merged_from=[b + 3, b + 4],
        first_seen=Time(sec=b + 5, nanosec=b + 6), last_seen=Time(sec=b + 7, nanosec=b + 8),
        plane=Plane(coef=floats(b + 9, 4)), pose=pose(b + 13), size=vector(b + 20), centroid=vector(b + 23, Point),
        point_covariance=floats(b + 26, 9), plane_covariance=floats(b + 35, 9), rms_error=b + 44.5, area=b + 45.5,
        voxel_count=b + 46, point_count=b + 47, boundary=polygon(b + 48), holes=[polygon(b + 57), polygon(b + 66)])


def color(first):
    r, g, b, a = floats(first, 4)
    return ColorRGBA(r=r, g=g, b=b, a=a)


def marker():
    return Marker(
        header=header(31, "map"), ns="clusters", id=33, type=Marker.CUBE_LIST, action=Marker.MODIFY, pose=pose(34),
        scale=vector(41), color=color(44), lifetime=Duration(sec=48, nanosec=49), frame_locked=True,
        points=[vector(50, Point), vector(53, Point)], colors=[color(56), color(60)], texture_resource="texture",
        uv_coordinates=[UVCoordinate(u=64.5, v=65.5)], text="66", mesh_resource="mesh", mesh_use_embedded_materials=True)


def cloud():
    fields = [PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate("xyz")]
    return PointCloud2(
        header=header(21, "camera_depth_optical_frame"), height=1, width=2, fields=fields, is_bigendian=False,
        point_step=16, row_step=32, data=bytes(range(1, 33)), is_dense=True)


def image():
    return Image(
        header=header(101, "camera_depth_optical_frame"), height=2, width=3, encoding="16UC1", is_bigendian=1, step=8,
        data=bytes(range(1, 17)))


def camera_info():
    return CameraInfo(
        header=header(111, "camera_depth_optical_frame"), height=113, width=114, distortion_model="plumb_bob",
        d=floats(115, 5), k=floats(120, 9), r=floats(129, 9), p=floats(138, 12), binning_x=150, binning_y=151,
        roi=RegionOfInterest(x_offset=152, y_offset=153, height=154, width=155, do_rectify=True))


def compressed_image():
    return CompressedImage(
        header=header(161, "camera_depth_optical_frame"), format="16UC1; compressedDepth png", data=bytes(range(1, 8)))


def transform(first, parent, child):
    at = pose(first + 2)
    p = at.position
    return TransformStamped(
        header=header(first, parent), child_frame_id=child,
        transform=Transform(translation=Vector3(x=p.x, y=p.y, z=p.z), rotation=at.orientation))


def detection(first):
    hypothesis = ObjectHypothesis(class_id="floor", score=first + 2.5)
    result = ObjectHypothesisWithPose(
        hypothesis=hypothesis, pose=PoseWithCovariance(pose=pose(first + 3), covariance=floats(first + 10, 36)))
    box = BoundingBox3D(center=pose(first + 46), size=vector(first + 53))
    return Detection3D(header=header(first, "odom"), results=[result], bbox=box, id=str(first + 56))


MESSAGES = {
    "surface_cluster_array": SurfaceClusterArray(
        header=header(11, "map"), session_id=2**63 + 13, sequence=14, base_sequence=15, kind=SurfaceClusterArray.DELTA,
        clusters=[cluster(1), cluster(2)], removed=[16, 17], unclustered_voxels=18),
    "surface_cluster_array_empty": SurfaceClusterArray(),
    "point_cloud2": cloud(),
    "image": image(),
    "camera_info": camera_info(),
    "compressed_image": compressed_image(),
    "marker_array": MarkerArray(markers=[marker()]),
    "tf_message": TFMessage(transforms=[transform(70, "map", "camera_link"), transform(80, "camera_link", "optical")]),
    "clock": Clock(clock=Time(sec=91, nanosec=92)),
    "detection3d_array": Detection3DArray(header=header(100, "odom"), detections=[detection(110), detection(210)]),
    "polygon_instance_stamped": PolygonInstanceStamped(
        header=header(300, "odom"), polygon=PolygonInstance(polygon=polygon(302), id=-(2**62) - 311)),
    "trigger_request": Trigger.Request(),
    "trigger_response": Trigger.Response(success=True, message="saved"),
}


SIZES = {"boolean": 1, "octet": 1, "uint8": 1, "int8": 1, "uint16": 2, "int16": 2, "uint32": 4, "int32": 4, "float": 4,
         "uint64": 8, "int64": 8, "double": 8}


def walk(value, kind, at, spans):
    """Where `value` of IDL type `kind`, written from `at` on, ends; `spans` gets the (start, end) of each of its parts.

    CDR: a number stands at a multiple of its size; what lies between is padding.
    """
    inner = re.fullmatch(r"sequence<(.+)>|(.+)\[\d+\]", kind)
    if inner or kind == "string":
        if not (inner and inner[2]):
            at = walk(0, "uint32", at, spans)
        items, item_kind = (value, inner[1] or inner[2]) if inner else (value.encode() + b"\0", "uint8")
        for item in items:
            at = walk(item, item_kind, at, spans)
    elif kind in SIZES:
        at += -at % SIZES[kind] + SIZES[kind]
        spans.append((at - SIZES[kind], at))
    else:
        for name, field in value.get_fields_and_field_types().items():
            at = walk(getattr(value, name), field, at, spans)
    return at


def canonical(message):
    """The bytes that ROS 2 writes, without what it leaves to chance: padding is zero, and nothing follows the last field.

    Its buffers come from an estimate: a few stray bytes may stand behind an empty list or an empty message.
    """
    data, spans = serialize_message(message), []
    end = max(walk(message, type(message).__name__, 0, spans), 1)  # no fields: one byte all the same
    assert 0 <= len(data) - 4 - end < 8, f"{type(message)}: {len(data) - 4} bytes, its fields end at {end}"
    zeroed = bytearray(4 + end)
    zeroed[:4] = data[:4]
    for start, stop in spans:
        zeroed[4 + start:4 + stop] = data[4 + start:4 + stop]
    return bytes(zeroed)


def values(message, path=""):
    """(field, value) of every number and text; lists of numbers are one value."""
    for name in message.get_fields_and_field_types():
        value, here = getattr(message, name), f"{path}{name}"
        if hasattr(value, "get_fields_and_field_types"):
            yield from values(value, here + ".")
        elif isinstance(value, list) and value and hasattr(value[0], "get_fields_and_field_types"):
            for i, item in enumerate(value):
                yield from values(item, f"{here}[{i}].")
        else:
            yield here, list(map(plain, value)) if hasattr(value, "__len__") and not isinstance(value, str) else plain(value)


def plain(value):
    return value.item() if hasattr(value, "item") else value


def table():
    lines = ["# Golden messages", "",
             "CDR bytes as real ROS 2 (Jazzy, rclpy on Fast DDS) serialises them, with the four bytes `00 01 00 00` in front.",
             "Padding is zero here (ROS 2 leaves there what the memory held) and nothing stands behind the last field (ROS 2",
             "may leave up to seven stray bytes there: a reader must not mind). A message without fields is one zero byte.",
             "Made by `tests/ros/golden.py`, which also writes this table. Text is in quotes, `[]` is an empty list.", ""]
    for name, message in MESSAGES.items():
        lines += [f"## {name}.cdr: {type(message).__module__.split('.')[0]}/{type(message).__name__}, "
                  f"{len(canonical(message))} bytes", "", "| field | value |", "|---|---|"]
        for field, value in values(message):
            lines.append(f"| {field} | " + (f'"{value}"' if isinstance(value, str) else str(value)) + " |")
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    for name, message in MESSAGES.items():
        (FOLDER / f"{name}.cdr").write_bytes(canonical(message))
    (FOLDER / "README.md").write_text(table())
