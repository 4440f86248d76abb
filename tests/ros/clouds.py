"""Clouds and transforms as serialised messages: built once, then only their stamp changes."""

import array
import csv
import json
import struct
import types

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from PIL import Image
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

OPTICAL = "camera_depth_optical_frame"
LINK_FROM_OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # x y z w; camera_link: x forward, z up; optical: z forward, y down
CLOUD_STAMP, TF_STAMP = 4, 8  # where the first stamp stands: behind the CDR header; behind the list's length too


def stamped(data, offset, stamp_ns):
    """The serialised message `data` with another stamp."""
    stamp = struct.pack("<iI", stamp_ns // 10**9, stamp_ns % 10**9)
    view = memoryview(data)
    return b"".join((view[:offset], stamp, view[offset + 8:]))


def cloud_message(points, frame_id=OPTICAL, fields="xyz"):
    """PointCloud2 of `points`: float32 of shape (height, width, floats per point). The fields are float32 at 0, 4, 8
    (and `rgb` at 16 where a point has 8 floats, as PCL lays it out)."""
    height, width, floats = points.shape
    offsets = dict(zip(fields, (0, 4, 8))) | ({"rgb": 16} if floats == 8 else {})
    return PointCloud2(
        header=Header(frame_id=frame_id), height=height, width=width,
        fields=[PointField(name=n, offset=o, datatype=PointField.FLOAT32, count=1) for n, o in offsets.items()],
        is_bigendian=False, point_step=4 * floats, row_step=4 * floats * width, is_dense=False,
        data=array.array("B", np.ascontiguousarray(points, np.float32).tobytes()))


def cloud(points, **more):
    return bytes(serialize_message(cloud_message(points, **more)))


def transform(parent, child, translation=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0, 1.0)):
    """TFMessage of one transform, serialised."""
    x, y, z = map(float, translation)
    qx, qy, qz, qw = map(float, rotation)
    return bytes(serialize_message(TFMessage(transforms=[TransformStamped(
        header=Header(frame_id=parent), child_frame_id=child,
        transform=Transform(translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=qx, y=qy, z=qz, w=qw)))])))


def static_transform():
    return transform("camera_link", OPTICAL, rotation=LINK_FROM_OPTICAL)


def still_transform():
    """map -> camera_link of a camera that stands still."""
    return transform("map", "camera_link", (0.0, 0.0, 1.0))


def wall(distance=2.04, side=60):
    """A wall of 1 m x 1 m in front of the camera: small enough for any socket buffer, dense enough for every voxel."""
    across = np.linspace(-0.5, 0.5, side, dtype=np.float32)
    points = np.empty((side, side, 4), np.float32)
    points[..., 0], points[..., 1], points[..., 2], points[..., 3] = across[None, :], across[:, None], distance, 0
    return points


def speck():
    """A cloud of one point, a valid one: the smallest scan that says which scans before it were lost."""
    return np.array([[[0.0, 0.0, 1.0, 0.0]]], np.float32)


def cabinet(folder, point_step=16, count=None):
    """The cabinet recording, a scan at a time: `.cloud` and `.transform` (map -> camera_link), both serialised.

    Organised 640x480 clouds in float32 as drivers make them; with 32 bytes a point also PCL's colour field.
    """
    camera = cabinet_camera(folder)
    fx, _, cx, _, fy, cy = map(np.float32, camera["K"][:6])
    scale = np.float32(camera["depth_scale_per_m"])
    u, v = np.meshgrid(*(np.arange(camera[side], dtype=np.float32) for side in ("width", "height")))
    for depth, transform in cabinet_rows(folder, count):
        z = depth.astype(np.float32) / scale
        z[depth == 0] = np.nan
        points = np.zeros((*depth.shape, point_step // 4), np.float32)
        points[..., 0], points[..., 1], points[..., 2] = (u - cx) * z / fx, (v - cy) * z / fy, z
        if point_step == 32:
            points[..., 3] = 1.0  # PCL leaves 1 in the fourth float
            grey = np.clip(255 - np.nan_to_num(z, nan=0) * 50, 0, 255).astype(np.uint32)
            points[..., 4] = (grey << 16 | grey << 8 | grey).view(np.float32)
        yield types.SimpleNamespace(cloud=cloud(points), transform=transform)


def cabinet_camera(folder):
    return json.loads((folder / "tum_fr3_cabinet58" / "camera.json").read_text())


def cabinet_rows(folder, count=None):
    """The depth images, 0 where unknown, in the units of the camera, with `transform` (map -> camera_link), serialised."""
    folder = folder / "tum_fr3_cabinet58"
    for row in list(csv.DictReader((folder / "poses.csv").open()))[:count]:
        depth = np.array(Image.open(folder / row["file"])).astype(np.uint16)
        depth[depth == 65535] = 0
        optical = [float(row[name]) for name in ("qx", "qy", "qz", "qw")]
        x, y, z, w = LINK_FROM_OPTICAL
        rotation = quaternion_product(optical / np.linalg.norm(optical), (-x, -y, -z, w))
        translation = [float(row[name]) for name in ("tx", "ty", "tz")]
        yield depth, transform("map", "camera_link", translation, rotation)


def quaternion_product(a, b):
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz)
