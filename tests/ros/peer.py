"""The other side of the talk: a real ROS 2 node that publishes, records what comes as raw bytes, and calls services."""

import threading
import time

import rclpy
from cfodi_msgs.msg import SurfaceClusterArray
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

import clouds


def qos(depth, reliable=True, latched=False):
    return QoSProfile(
        depth=depth, history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE)


def wait_until(what, condition, timeout=60):
    """The first true value of `condition()`; fails with `what`, a text or what gives one then, where there is none in time."""
    end = time.monotonic() + timeout
    while not (value := condition()):
        assert time.monotonic() < end, f"not within {timeout} s: {what() if callable(what) else what}"
        time.sleep(0.02)
    return value


def send_until(what, send, condition, pause=0.1):
    """The first true value of `condition()`, for which a busy machine may need more than one of what `send()` sends: it is sent
    again and again, with a pause (s) after each time."""
    def met():
        send()
        time.sleep(pause)
        return condition()

    return wait_until(what, met)


def until_taken_in(send, deltas, seconds=3, attempts=10):
    """Sends a scan by `send()`, which returns its stamp, and another one where its delta does not come within so many seconds;
    returns the delta. What was sent before is then on its way no more."""
    for _ in range(attempts):
        sent = send()
        try:
            return deltas.wait("the delta of a scan", lambda message: stamp(message) == sent, timeout=seconds)
        except AssertionError:
            continue
    raise AssertionError(f"none of {attempts} scans was taken in")


def stamp(message):
    """That of its header (ns)."""
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


class Recording:
    """Serialised messages of one topic as they came; decoded on demand, so that recording loses none by being slow."""

    def __init__(self, message_type):
        self.raw = []  # (monotonic time of arrival, bytes)
        self._type, self._decoded = message_type, {}

    def __len__(self):
        return len(self.raw)

    def __getitem__(self, index):
        index = range(len(self.raw))[index]
        if index not in self._decoded:
            self._decoded[index] = deserialize_message(self.raw[index][1], self._type)
        return self._decoded[index]

    def wait(self, what, condition=lambda message: True, timeout=60, after=0):
        """The first message from number `after` on that meets the condition."""
        seen = after

        def found():
            nonlocal seen
            while seen < len(self.raw):
                seen += 1
                if condition(self[seen - 1]):
                    return [self[seen - 1]]
            return []

        return wait_until(what, found, timeout)[0]


class Peer:
    def __init__(self, name="peer", domain=0):
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node(name, context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self):
        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass

    def close(self):
        self._executor.shutdown(timeout_sec=5)
        self.context.try_shutdown()
        self._thread.join()
        self.node.destroy_node()

    def record(self, topic, message_type, profile):
        recording = Recording(message_type)
        self.node.create_subscription(
            message_type, topic, lambda data: recording.raw.append((time.monotonic(), bytes(data))), profile, raw=True)
        return recording

    def record_node(self, name="/cfodi"):
        """Recordings of all that a node publishes on the map: clusters, deltas, markers, labelled."""
        self.clusters = self.record(f"{name}/clusters", SurfaceClusterArray, qos(100, latched=True))
        self.deltas = self.record(f"{name}/clusters_delta", SurfaceClusterArray, qos(2000))
        self.markers = self.record(f"{name}/markers", MarkerArray, qos(100, latched=True))
        self.labelled = self.record(f"{name}/points_labelled", PointCloud2, qos(100, reliable=False))
        recorded = ("clusters", "clusters_delta", "markers", "points_labelled")
        wait_until("publishers of the map", lambda: all(self.node.count_publishers(f"{name}/{t}") for t in recorded))

    def camera(self, topic="/camera/depth/points"):
        return Camera(self.node, topic)

    def depth_camera(self, info, suffix="", reliable=False):
        topic = "/camera/depth/image_raw" + suffix
        return DepthCamera(self.node, topic, "/camera/depth/camera_info", info, reliable)

    def call(self, service_type, name, request, attempts=3, timeout=8):
        """The reply to a call. While the two sides meet it takes a heartbeat (3 s), and where a node has just come under the name
        of another it may get none: it is asked again then, and not before, for a call that is late is run all the same."""
        client = self.node.create_client(service_type, name)
        try:
            assert client.wait_for_service(60), f"no service {name}"
            for _ in range(attempts):
                future = client.call_async(request)
                end = time.monotonic() + timeout
                while not future.done() and time.monotonic() < end:
                    time.sleep(0.01)
                if future.done():
                    return future.result()
                client.remove_pending_request(future)
            raise AssertionError(f"{name} did not answer {attempts} calls")
        finally:
            self.node.destroy_client(client)


class Camera:
    """Publishes clouds best effort, as drivers do, and the transforms that belong to them."""

    def __init__(self, node, topic, message_type=PointCloud2, reliable=False):
        self.sent = 0
        self._cloud = node.create_publisher(message_type, topic, qos(5, reliable=reliable))
        self._tf = node.create_publisher(TFMessage, "/tf", qos(100))
        self._tf_static = node.create_publisher(TFMessage, "/tf_static", qos(1, latched=True))
        self._tf_static.publish(clouds.static_transform())

    def meet(self, timeout=60):
        """Waits for the node. What a best-effort subscription misses before it is matched on both sides, nobody counts:
        hence the pause. The static transform goes out again, for a latched one may take a heartbeat (3 s) to arrive; that the node
        has it shows that it knows this side."""
        publishers = (self._cloud, self._tf, self._tf_static)
        wait_until("a subscription of points, /tf and /tf_static",
                   lambda: all(p.get_subscription_count() for p in publishers), timeout)
        time.sleep(0.5)
        self._tf_static.publish(clouds.static_transform())
        # Of a reader that was killed nobody hears before it is forgotten.
        self._tf_static.wait_for_all_acked(Duration(seconds=5))
        time.sleep(1.0)

    def publish(self, cloud, stamp_ns, transform=None):
        """One serialised cloud, after the transform (none: no transform) with the same stamp, which is returned."""
        if transform is not None:
            self._tf.publish(clouds.stamped(transform, clouds.TF_STAMP, stamp_ns))
        self.publish_as_is(clouds.stamped(cloud, clouds.CLOUD_STAMP, stamp_ns))
        return stamp_ns

    def publish_as_is(self, data):
        self.sent += 1
        self._cloud.publish(data)


class DepthCamera(Camera):
    """Publishes depth images, each after its camera info (`info`, serialised; None: none)."""

    def __init__(self, node, topic, info_topic, info, reliable):
        compressed = topic.endswith("/compressedDepth")
        super().__init__(node, topic, CompressedImage if compressed else Image, reliable)
        self.info = info
        self._info = node.create_publisher(CameraInfo, info_topic, qos(5))

    def meet(self, timeout=60):
        wait_until("a subscription of the camera info", self._info.get_subscription_count, timeout)
        super().meet(timeout)

    def publish(self, cloud, stamp_ns, transform=None):
        if self.info is not None:
            self._info.publish(clouds.stamped(self.info, clouds.CLOUD_STAMP, stamp_ns))
        return super().publish(cloud, stamp_ns, transform)
