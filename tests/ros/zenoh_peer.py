"""Another program on Zenoh: a router (eclipse-zenoh), and a robot by the conventions of rmw_zenoh (zenoh-ros2-sdk), which takes
hashes and layouts from the definitions that ROS has installed."""

import json
import os
import pathlib
import subprocess
import sys
import time

os.environ["GIT_PYTHON_REFRESH"] = "quiet"  # the SDK imports it

import zenoh
from rclpy.serialization import deserialize_message, serialize_message
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber, ZenohSession, get_registry
from zenoh_ros2_sdk import message_registry
from zenoh_ros2_sdk.attachment import Attachment
from zenoh_ros2_sdk.keyexpr import topic_keyexpr

import clouds
from peer import wait_until

PORT = 7447
CLOUD, TF = "sensor_msgs/msg/PointCloud2", "tf2_msgs/msg/TFMessage"
IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
ARRAY, MARKERS = "cfodi_msgs/msg/SurfaceClusterArray", "visualization_msgs/msg/MarkerArray"
TRANSFORMS = (clouds.static_transform(), clouds.still_transform())
ROUTER = f"""import sys, zenoh
config = zenoh.Config()
for key, value in (("mode", '"router"'), ("listen/endpoints", '["tcp/127.0.0.1:{PORT}"]'),
                   ("scouting/multicast/enabled", "false")):
    config.insert_json5(key, value)
session = zenoh.open(config)
print("there", flush=True)
sys.stdin.read()
session.close()
"""


class Router:
    """A Zenoh router on the loopback interface."""

    def __init__(self):
        self._process = subprocess.Popen(
            [sys.executable, "-c", ROUTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self._process.stdout.readline() == "there\n"

    def end(self):
        self._process.stdin.close()
        self._process.wait(20)


# It would ask the internet for what it does not find.
message_registry.get_repository_for_package = lambda package: None


def shares():
    """Where ROS has installed what packages share."""
    return [pathlib.Path(prefix) / "share" for prefix in os.environ["AMENT_PREFIX_PATH"].split(":")]


def installed_hash(name):
    """The hash of a type as ROS has computed it."""
    package, rest = name.split("/", 1)
    file = next(file for share in shares() if (file := share / package / f"{rest}.json").exists())
    hashes = json.loads(file.read_text())["type_hashes"]
    return next(entry["hash_string"] for entry in hashes if entry["type_name"] == name)


def definitions(folder):
    """All in one folder, as PACKAGE/msg/NAME.msg, where the SDK looks for them."""
    for share in shares():
        for package in share.iterdir():
            if any((package / kind).is_dir() for kind in ("msg", "srv")):
                (folder / package.name).symlink_to(package)
    return folder


class Inbox(list):
    """The messages of a topic."""

    def wait(self, what, condition=lambda message: True, timeout=60):
        """The first that meets the condition."""
        return wait_until(what, lambda: [message for message in self if condition(message)], timeout)[0]


class Robot:
    """Publishes what a driver does, and reads what the node sends; of serialised messages the SDK makes its own."""

    def __init__(self, folder):
        registry = get_registry()
        registry.messages_dir = folder
        registry._loaded_types.clear()  # those of a session before
        self.session = ZenohSession.get_instance("127.0.0.1", PORT)
        self.sent, self._calls, self._ends, self._publishers = 0, 0, [], {}

    def close(self):
        for end in self._ends:
            end.close()
        self.session.close()
        ZenohSession._instance = None

    def _keep(self, end):
        self._ends.append(end)
        return end

    def publisher(self, topic, message_type, namespace="/"):
        if topic not in self._publishers:
            self._publishers[topic] = self._keep(ROS2Publisher(topic, message_type, namespace=namespace))
        return self._publishers[topic]

    def publish(self, topic, message_type, data):
        """A serialised message, once more by the SDK."""
        publisher = self.publisher(topic, message_type)
        message = self.session.store.deserialize_cdr(data, message_type)
        fields = {name: getattr(message, name) for name in message.__dataclass_fields__ if name != "__msgtype__"}
        publisher.publish(**fields)

    def publish_transforms(self, stamp, transforms=TRANSFORMS):
        for transform in transforms:
            self.publish("/tf", TF, clouds.stamped(transform, clouds.TF_STAMP, stamp))

    def publish_scan(self, topic, message_type, data, stamp):
        self.publish(topic, message_type, clouds.stamped(data, clouds.CLOUD_STAMP, stamp))
        self.sent += 1

    def read(self, topic, message_type, **more):
        inbox = Inbox()
        self._keep(ROS2Subscriber(topic, message_type, callback=inbox.append, **more))
        return inbox

    def meet(self, name="/cfodi"):
        """Waits for a link to a node: what is sent while the two sides go over to it from the router may be lost."""
        token = f"@ros2_lv/0/*/0/0/NN/%/*/{name.rsplit('/', 1)[1]}"

        def linked():
            nodes = {str(reply.ok.key_expr).split("/")[2] for reply in self.session.liveliness.get(token) if reply.ok}
            return nodes and nodes <= {str(peer) for peer in self.session.session.info.peers_zid()}
        wait_until(f"a link to {name}", linked)
        time.sleep(1.5)

    def are_read(self, *topics):
        """Which of these somebody reads, by one look: one that comes back empty tells nothing of what is read no more."""
        replies = self.session.liveliness.get("@ros2_lv/0/*/*/*/MS/**")
        named = {str(reply.ok.key_expr).split("/")[9].replace("%", "/") for reply in replies if reply.ok is not None}
        return tuple(topic in named for topic in topics)

    def trigger(self, service, attempts=6):
        """The answer to a call; asked again where none comes, while the two sides meet."""
        client = self._keep(ROS2ServiceClient(
            service, "std_srvs/srv/Trigger", request_definition="uint8 structure_needs_at_least_one_member",
            response_definition="bool success\nstring message", timeout=3.0))
        for _ in range(attempts):
            if (answer := client.call(structure_needs_at_least_one_member=0)) is not None:
                return answer
        raise AssertionError(f"{service} did not answer {attempts} calls")

    def call(self, service, service_type, request, attempts=6):
        """The same for any service whose calls may be run twice, in the bytes of rclpy."""
        package, kind = service_type.__module__.split(".")[0], service_type.__name__
        hash_of_type = installed_hash(f"{package}/srv/{kind}")
        key = topic_keyexpr(0, service, f"{package}::srv::dds_::{kind}_", hash_of_type)
        for _ in range(attempts):
            self._calls += 1
            replies = self.session.session.get(
                key, target=zenoh.QueryTarget.ALL_COMPLETE, payload=serialize_message(request), timeout=10.0,
                attachment=Attachment(self._calls, time.time_ns(), b"peer" * 4).to_bytes())
            if (reply := next(iter(replies), None)) is not None:
                assert Attachment.from_bytes(reply.ok.attachment.to_bytes()).sequence_id == self._calls
                return deserialize_message(reply.ok.payload.to_bytes(), service_type.Response)
            time.sleep(1)
        raise AssertionError(f"{service} did not answer {attempts} calls")

    def drive(self, topic="/camera/depth/points", count=20, rate=20, transforms=TRANSFORMS):
        """Clouds of a wall, each with its transforms; returns the last stamp."""
        cloud = clouds.cloud(clouds.wall())
        for _ in range(count):
            stamp = time.time_ns()
            self.publish_transforms(stamp, transforms)
            self.publish_scan(topic, CLOUD, cloud, stamp)
            time.sleep(1 / rate)
        return stamp

    def put(self, topic, message_type, data, attachment=None):
        """Any bytes, as a message of that type."""
        self.publisher(topic, message_type).pub.put(data, attachment=attachment)

    def latch(self, publisher, data):
        """Publishes as rmw_zenoh does what is kept for late readers."""
        advanced = zenoh.ext.declare_advanced_publisher(
            self.session.session, publisher.keyexpr, cache=zenoh.ext.CacheConfig(1), publisher_detection=True)
        advanced.put(data, attachment=publisher._create_attachment(1, time.time_ns()))
        return advanced
