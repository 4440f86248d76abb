"""Messages made to harm, on the topics of the robot."""

import time

import clouds
import numpy as np
from peer import Peer, qos
from rclpy.serialization import serialize_message
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage


def _altered(**changes):
    message = clouds.cloud_message(clouds.wall())
    for name, value in changes.items():
        setattr(message, name, value)
    return bytes(serialize_message(message))


def _clouds():
    rng = np.random.default_rng(1)
    yield clouds.cloud(clouds.wall(), fields="abc")
    yield _altered(data=bytes(100))
    yield _altered(width=2**31, height=2**31)
    yield _altered(row_step=4)
    yield _altered(point_step=0)
    yield clouds.cloud(clouds.wall(), frame_id="")
    yield clouds.cloud(clouds.wall(), frame_id="f" * 100_000)
    for length in (0, 3, 200):
        yield bytes([0, 1, 0, 0]) + rng.bytes(length)


def _transforms():
    """None of them is about the robot's frames but the one without a rotation, which is none."""
    yield clouds.transform("map", "camera_link", rotation=(0.0, 0.0, 0.0, 0.0))
    yield clouds.transform("map", "camera_link", (float("nan"), 0.0, 0.0))
    yield clouds.transform("one", "other")
    yield clouds.transform("other", "one")
    yield clouds.transform("self", "self")


class Stranger:
    """`sent` counts the clouds; each is to be skipped for a reason."""

    def __init__(self, topic):
        self.sent = 0
        self._peer = Peer("stranger")
        self._cloud = self._peer.node.create_publisher(PointCloud2, topic, qos(5, reliable=False))
        self._tf = self._peer.node.create_publisher(TFMessage, "/tf", qos(100))
        self._clouds, self._transforms = list(_clouds()), list(_transforms())

    def sends(self):
        for cloud in self._clouds:
            self._cloud.publish(cloud)
            self.sent += 1
            time.sleep(0.02)
        for transform in self._transforms:
            self._tf.publish(clouds.stamped(transform, clouds.TF_STAMP, time.time_ns()))

    def close(self):
        self._peer.close()
