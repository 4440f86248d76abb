"""Bags as users have them: recordings made and converted by the tools that users have, and shapes written message by
message."""

import os
import pathlib
import struct
import subprocess
import sys

import cv2
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
DATA = pathlib.Path(os.environ.get("CFODI_DATA") or REPOSITORY.parent / "shared" / "data")
TOOLS = pathlib.Path(os.environ.get("CFODI_TOOLS") or REPOSITORY.parent / "shared" / "tools")
FULL = os.environ.get("CFODI_FULL_BAGS") == "1"

POINTS, IMAGE, INFO = "/camera/depth/points", "/camera/depth/image_raw", "/camera/depth/camera_info"
OPTICAL = "camera_depth_optical_frame"
LINK_FROM_OPTICAL = (-0.5, 0.5, -0.5, 0.5)  # x y z w; camera_link: x forward, z up; optical: z forward, y down
COMPRESSIONS = {"plain": (), **{mode: ("--compress", "zstd", "--compress-mode", mode)
                                for mode in ("storage", "message", "file")}}
TF, OLD_TF = "tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"  # the second: ROS 1 before 2013, TUM's recordings among them
SECOND = 10**9


def run(*command):
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, f"{command} ends with {done.returncode}:\n{done.stdout}{done.stderr}"


def record(bag, sequence, *options):
    """A ROS 1 bag of one of the recordings (`tum_fr3_cabinet58`, `tum_rpy179`)."""
    run(sys.executable, TOOLS / "rgbd_to_bag.py", "--seq", DATA / sequence, "--out", bag, *options)
    return bag


def convert(bag, folder, *options, storage="mcap"):
    """What `rosbags-convert` makes of a bag: a folder with metadata.yaml and the file. Returns the folder."""
    run("rosbags-convert", "--src", bag, "--dst", folder, "--dst-storage", storage, *options)
    return folder


def only_file(folder):
    """The file with the messages in a folder of `rosbags-convert`."""
    (found,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
    return found


def messages(bag, *topics):
    """(topic, log time [ns], message) of a bag's folder or file, as `rosbags` reads them; without topics, of all."""
    with AnyReader([pathlib.Path(bag)]) as reader:
        wanted = [c for c in reader.connections if not topics or c.topic in topics]
        for connection, stamp, data in reader.messages(wanted) if wanted else ():
            yield connection.topic, stamp, reader.deserialize(data, connection.msgtype)


class Bag:
    """A rosbag2 folder with one MCAP file, written message by message; the times are in ns."""

    def __init__(self, folder):
        self.folder = folder
        self._writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        self._store = get_typestore(Stores.ROS2_JAZZY)
        self._store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", OLD_TF))
        self._connections = {}

    def __enter__(self):
        self._writer.open()
        return self

    def __exit__(self, *_):
        self._writer.close()

    def type(self, name):
        return self._store.types[name]

    def write(self, topic, log_time, message):
        kind = message.__msgtype__
        if topic not in self._connections:
            self._connections[topic] = self._writer.add_connection(topic, kind, typestore=self._store)
        self._writer.write(self._connections[topic], log_time, self._store.serialize_cdr(message, kind))

    def header(self, stamp, frame):
        time = self.type("builtin_interfaces/msg/Time")(sec=stamp // SECOND, nanosec=stamp % SECOND)
        return self.type("std_msgs/msg/Header")(stamp=time, frame_id=frame)

    def transform(self, log_time, parent, child, translation=(0, 0, 0), rotation=(0, 0, 0, 1), topic="/tf", kind=TF):
        """One transform that maps `child` into `parent`, stamped as it is logged."""
        vector, quaternion = self.type("geometry_msgs/msg/Vector3"), self.type("geometry_msgs/msg/Quaternion")
        transform = self.type("geometry_msgs/msg/Transform")(
            translation=vector(*map(float, translation)), rotation=quaternion(*map(float, rotation)))
        one = self.type("geometry_msgs/msg/TransformStamped")(
            header=self.header(log_time, parent), child_frame_id=child, transform=transform)
        self.write(topic, log_time, self.type(kind)(transforms=[one]))

    def static(self, log_time, parent="camera_link", child=OPTICAL, rotation=LINK_FROM_OPTICAL):
        self.transform(log_time, parent, child, rotation=rotation, topic="/tf_static")

    def cloud(self, stamp, points, topic=POINTS, frame=OPTICAL, log_time=None):
        """PointCloud2 of float32 points of shape (height, width, 3)."""
        field, (height, width, _) = self.type("sensor_msgs/msg/PointField"), points.shape
        padded = np.zeros((height, width, 4), np.float32)
        padded[..., :3] = points
        self.write(topic, stamp if log_time is None else log_time, self.type("sensor_msgs/msg/PointCloud2")(
            header=self.header(stamp, frame), height=height, width=width,
            fields=[field(name, 4 * i, 7, 1) for i, name in enumerate("xyz")], is_bigendian=False,
            point_step=16, row_step=16 * width, data=padded.view(np.uint8).ravel(), is_dense=False))

    def image(self, stamp, depth, topic=IMAGE, frame=OPTICAL):
        """Depth image: 16UC1 [mm] of uint16, 32FC1 [m] of float32."""
        encoding = {"uint16": "16UC1", "float32": "32FC1"}[depth.dtype.name]
        height, width = depth.shape
        self.write(topic, stamp, self.type("sensor_msgs/msg/Image")(
            header=self.header(stamp, frame), height=height, width=width, encoding=encoding, is_bigendian=0,
            step=width * depth.itemsize, data=np.ascontiguousarray(depth).view(np.uint8).ravel()))

    def compressed(self, stamp, depth, topic, frame=OPTICAL, inverse=None):
        """uint16 depth as PNG, under the header of `compressedDepth` where the topic ends in it, else bare. With
        `inverse` = (a, b) the values stand for a / (value - b) metres, as image_transport packs a 32FC1 image."""
        png = cv2.imencode(".png", depth)[1].tobytes()
        if topic.endswith("compressedDepth"):
            image_format = f"{'32FC1' if inverse else '16UC1'}; compressedDepth png"
            data = struct.pack("<iff", 0, *(inverse or (0, 0))) + png
        else:
            image_format, data = "16UC1; png compressed ", png
        self.write(topic, stamp, self.type("sensor_msgs/msg/CompressedImage")(
            header=self.header(stamp, frame), format=image_format, data=np.frombuffer(data, np.uint8)))

    def info(self, stamp, width, height, focal, topic=INFO, frame=OPTICAL):
        """CameraInfo of a camera that looks through the middle of its image."""
        cx, cy = (width - 1) / 2, (height - 1) / 2
        self.write(topic, stamp, self.type("sensor_msgs/msg/CameraInfo")(
            header=self.header(stamp, frame), height=height, width=width, distortion_model="plumb_bob", d=np.zeros(5),
            k=np.array([focal, 0, cx, 0, focal, cy, 0, 0, 1]), r=np.eye(3).ravel(),
            p=np.array([focal, 0, cx, 0, 0, focal, cy, 0, 0, 0, 1, 0.0]), binning_x=0, binning_y=0,
            roi=self.type("sensor_msgs/msg/RegionOfInterest")(0, 0, 0, 0, False)))
