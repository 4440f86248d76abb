"""What comes in: bad clouds, missing transforms, clocks that jump, sensors that are not there."""

import itertools
import struct
import time

import clouds
import compare
import numpy as np
from builtin_interfaces.msg import Time
from cfodi_node import accounted, skipped
from peer import qos, send_until, wait_until
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, PointCloud2
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

SECOND = 10**9


def begin(start, peer, prefix=(), **parameters):
    """The node, recorded, and a camera that it hears."""
    node = start(parameters, prefix=prefix).ready()
    peer.record_node()
    camera = peer.camera()
    camera.meet()
    return node, camera


def take_in(camera, deltas, stamp=None, cloud=None):
    """Sends a good cloud and returns its delta."""
    stamp, before = stamp or time.time_ns(), len(deltas)
    camera.publish(clouds.cloud(clouds.wall()) if cloud is None else cloud, stamp, clouds.still_transform())
    return deltas.wait("the delta of a good cloud", lambda m: compare.stamp(m) == stamp, after=before)


def altered(**changes):
    """A good cloud with some fields changed."""
    message = clouds.cloud_message(clouds.wall())
    for name, value in changes.items():
        setattr(message, name, value)
    return bytes(serialize_message(message))


BAD = {
    "no field x": clouds.cloud(clouds.wall(), fields="abc"),
    "data too short": altered(data=bytes(100)),
    "dimensions beyond all data": altered(width=2**31, height=2**31),
    "row_step below a row": altered(row_step=4),
    "point_step of zero": altered(point_step=0),
    "more points than max_points": clouds.cloud(clouds.wall(side=80)),
}


def test_bad_clouds_are_counted_by_reason_and_the_next_good_one_is_taken_in(start, peer):
    node, camera = begin(start, peer, max_points=5000)
    for bad in BAD.values():
        camera.publish(bad, time.time_ns(), clouds.still_transform())
        time.sleep(0.1)
    camera.publish(clouds.cloud(clouds.wall(), frame_id=""), time.time_ns(), clouds.still_transform())
    rng = np.random.default_rng(1)
    for length in (0, 3, 200):
        camera.publish_as_is(bytes([0, 1, 0, 0]) + rng.bytes(length))
        time.sleep(0.1)
    huge = bytearray(clouds.cloud(clouds.wall()))
    struct.pack_into("<I", huge, 12, 0xFFFFFFFF)  # the length of the frame id
    camera.publish_as_is(bytes(huge))
    time.sleep(0.5)
    assert not len(peer.deltas), "a bad cloud was taken in"
    delta = take_in(camera, peer.deltas)
    assert delta.sequence == 1 and delta.clusters
    counts = node.stop()
    assert counts["taken_in"] == 1 and counts["lost"] == 0 and accounted(counts) == camera.sent, counts
    assert counts["skipped"] == {
        "missing_field": 1, "short_data": 1, "too_many_points": 2, "short_row_step": 1, "zero_point_step": 1,
        "empty_frame_id": 1, "undecodable": 4}


def test_a_cloud_without_a_transform_is_warned_of_by_both_frames_and_skipped(start, peer):
    node, camera = begin(start, peer)
    camera.publish(clouds.cloud(clouds.wall(), frame_id="unheard_of"), time.time_ns(), clouds.still_transform())
    node.line_with("map", "unheard_of")
    take_in(camera, peer.deltas)
    counts = node.stop()
    assert skipped(counts) == 1 and counts["taken_in"] == 1, counts
    assert "transform" in next(iter(counts["skipped"])), counts


def test_clouds_in_the_fixed_frame_of_a_robot_that_moves_are_warned_of_once(start, peer):
    node, camera = begin(start, peer)
    for _ in range(8):
        take_in(camera, peer.deltas, cloud=clouds.cloud(clouds.wall(), frame_id="map"))
    node.line_with("/camera/depth/points: clouds come in `map`, so that nobody knows where the sensor stood")
    node.stop()
    assert sum("clouds come in `map`" in line for line in node.lines) == 1


def test_a_transform_that_comes_after_its_cloud_is_waited_for(start, peer):
    node, camera = begin(start, peer, tf_timeout=30.0)
    stamp = time.time_ns()
    camera.publish(clouds.cloud(clouds.wall()), stamp)
    time.sleep(0.3)
    assert not len(peer.deltas)
    camera._tf.publish(clouds.stamped(clouds.still_transform(), clouds.TF_STAMP, stamp))
    peer.deltas.wait("the delta of the cloud that waited", lambda m: compare.stamp(m) == stamp)
    assert node.stop()["taken_in"] == 1


def test_a_latched_static_transform_from_before_the_node_started_counts(start, peer):
    camera = peer.camera()
    time.sleep(1)
    start().ready()
    peer.record_node()
    cloud, still = clouds.cloud(clouds.wall()), clouds.still_transform()
    send_until("a delta", lambda: camera.publish(cloud, time.time_ns(), still), lambda: len(peer.deltas), pause=0.5)


def test_reset_begins_a_new_session_with_an_empty_map(start, peer):
    node, camera = begin(start, peer)
    first = take_in(camera, peer.deltas)
    assert peer.call(Trigger, "/cfodi/reset", Trigger.Request()).success
    after = len(peer.clusters)
    empty = peer.clusters.wait("a snapshot of a new session", lambda m: m.session_id != first.session_id, after=after)
    again = take_in(camera, peer.deltas)
    assert (again.session_id, again.sequence, again.base_sequence) == (empty.session_id, 1, 0)
    assert [cluster.voxel_count for cluster in again.clusters] == [cluster.voxel_count for cluster in first.clusters]
    assert node.stop()["taken_in"] == 2


def test_a_stamp_that_jumps_back_by_minutes_begins_a_new_session(start, peer):
    node, camera = begin(start, peer)
    now = time.time_ns()
    for i in range(3):
        first = take_in(camera, peer.deltas, now + i * SECOND // 30)
    assert first.sequence == 3
    again = take_in(camera, peer.deltas, now - 600 * SECOND)
    assert again.session_id != first.session_id and (again.sequence, again.base_sequence) == (1, 0)
    snapshot = peer.clusters.wait("its snapshot", lambda m: (m.session_id, m.sequence) == (again.session_id, 1))
    assert compare.stamp(snapshot) == now - 600 * SECOND
    assert node.stop()["taken_in"] == 4


def test_a_simulated_clock_that_does_not_come_or_stops_is_said_and_that_it_comes_too(start, peer):
    node = start({"use_sim_time": True}).ready()
    node.line_with("no /clock has come, which use_sim_time asks for")
    clock = peer.node.create_publisher(Clock, "/clock", qos(1, reliable=False))
    wait_until("a subscription of /clock", clock.get_subscription_count)
    times = (Clock(clock=Time(sec=second)) for second in itertools.count(1))
    send_until("a line of the clock", lambda: clock.publish(next(times)), lambda: node.said("/clock comes now"))
    node.line_with("no /clock has come for 3 s: the simulated time stands still")
    node.stop()


def test_without_a_transform_it_lists_the_topics_that_could_be_meant(start, peer):
    """A robot whose transforms are below its namespace."""
    for name, latched in (("tf", False), ("tf_static", True)):
        peer.node.create_publisher(TFMessage, f"/robot1/{name}", qos(1, latched=latched))
    sensor = peer.node.create_publisher(PointCloud2, "/camera/depth/points", qos(5, reliable=False))
    cloud = clouds.cloud(clouds.wall())
    node = start(remaps={"/tf": "/base/tf"}).ready()
    words = ("nobody publishes on /base/tf and /tf_static", "use -r /tf:=/robot1/tf -r /tf_static:=/robot1/tf_static")
    send_until("the words that help", lambda: sensor.publish(clouds.stamped(cloud, clouds.CLOUD_STAMP, time.time_ns())),
               lambda: node.said(*words))
    node.stop()


def test_two_publishers_that_place_a_frame_differently_are_said(start, peer):
    node, camera = begin(start, peer)
    moving = peer.node.create_publisher(TFMessage, "/tf", qos(100))
    lasting = peer.node.create_publisher(TFMessage, "/tf_static", qos(1, latched=True))
    wait_until("the node", lambda: moving.get_subscription_count() and lasting.get_subscription_count())
    cloud, beside = clouds.cloud(clouds.wall()), clouds.transform("map", "camera_link", (0.0, 1.0, 1.0))

    def send():
        stamp = camera.publish(cloud, time.time_ns(), clouds.still_transform())
        moving.publish(clouds.stamped(beside, clouds.TF_STAMP, stamp))

    send_until("what is said of /tf", send, lambda: node.said("two publishers place camera_link below map by turns, 1.00 m and"))
    lasting.publish(clouds.transform("camera_link", clouds.OPTICAL, (0.0, 0.0, 0.5), clouds.LINK_FROM_OPTICAL))
    node.line_with(f"the static transform of {clouds.OPTICAL} below camera_link is another than before, by 0.500 m and")
    node.stop()


def test_without_a_publisher_it_lists_the_topics_that_could_be_meant(start, peer):
    peer.node.create_publisher(PointCloud2, "/other/points", qos(5, reliable=False))
    peer.node.create_publisher(Image, "/other/depth/image_raw", qos(5))
    node = start(points=None).ready()
    node.line_with("-r points:=/other/points")
    node.line_with("-r depth/image:=/other/depth/image_raw -r depth/camera_info:=/other/depth/camera_info")
    node.stop()
