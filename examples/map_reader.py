"""Keeps the map of surfaces that cfodi publishes: `python3 map_reader.py`, or copy the class MapReader."""

from collections import deque

BACK = 1.0  # a snapshot of a recording that is played again has a stamp more than this before the map's [s]


class MapReader:
    """Snapshots and deltas come on two topics, in no common order: deltas wait here until a snapshot fits under them."""

    def __init__(self, most_deltas=1000):
        self.session_id = None  # ids mean nothing beyond their session
        self.version = None  # `sequence` of the map in `clusters`
        self.clusters = {}  # id -> cfodi_msgs/SurfaceCluster
        self.latest = None  # the message that led to this version: its header and unclustered_voxels hold for the map
        self._newest = None  # `sequence` of the newest snapshot, taken or not
        self._deltas = deque(maxlen=most_deltas)

    def snapshot(self, message):
        before, self._newest = self._newest, message.sequence
        if message.session_id == self.session_id:
            # Snapshots come in their order, late and seldom as they may be: where they go back, a recording is played again.
            if message.sequence < before and seconds(self.latest) - seconds(message) > BACK:
                self._deltas.clear()  # of the time before
            elif message.sequence <= self.version:
                return  # the deltas were faster
        self.session_id, self.version, self.latest = message.session_id, message.sequence, message
        self.clusters = {cluster.id: cluster for cluster in message.clusters}
        self._catch_up()

    def delta(self, message):
        self._deltas.append(message)
        self._catch_up()

    def _catch_up(self):
        waiting, self._deltas = self._deltas, deque(maxlen=self._deltas.maxlen)
        for message in waiting:
            if message.session_id != self.session_id or message.base_sequence > self.version:
                self._deltas.append(message)  # of a session, or after a gap, that the next snapshot will cover
            elif message.base_sequence == self.version:
                for gone in message.removed:
                    self.clusters.pop(gone, None)
                self.clusters.update((cluster.id, cluster) for cluster in message.clusters)
                self.version, self.latest = message.sequence, message


def seconds(message):
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def main():
    import rclpy
    from cfodi_msgs.msg import SurfaceClusterArray
    from rclpy.qos import DurabilityPolicy, QoSProfile

    rclpy.init()
    node, reader = rclpy.create_node("map_reader"), MapReader()

    def show(take, message):
        take(message)
        node.get_logger().info(f"version {reader.version}: {len(reader.clusters)} clusters")

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(SurfaceClusterArray, "/cfodi/clusters", lambda m: show(reader.snapshot, m), latched)
    node.create_subscription(SurfaceClusterArray, "/cfodi/clusters_delta", lambda m: show(reader.delta, m), 20)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
