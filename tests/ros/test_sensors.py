"""Several sensors in one map, several nodes on one network, and what starts anew."""

import time
from collections import Counter

import clouds
import compare
import depth_images
import pytest
from cfodi_msgs.msg import SurfaceClusterArray
from cfodi_node import accounted
from peer import qos, send_until, until_taken_in, wait_until

BEHIND = "rear_optical_frame"
#: Looks along -x of the map, from a metre above its origin.
TURNED = clouds.quaternion_product((0.0, 0.0, 1.0, 0.0), clouds.LINK_FROM_OPTICAL)
TWO = {"sensors": "[front, rear]", "rear.kind": "depth"}
REMAPS = {
    "front": "/front/points", "rear/image": "/camera/depth/image_raw", "rear/camera_info": "/camera/depth/camera_info"}


def rear_transform():
    return clouds.transform("map", BEHIND, (0.0, 0.0, 1.0), TURNED)


def send_both(front, rear, count=30):
    """Returns the last two stamps."""
    cloud, image = clouds.cloud(clouds.wall()), depth_images.image(depth_images.wall(), frame_id=BEHIND)
    for _ in range(count):
        last = {front.publish(cloud, time.time_ns(), clouds.still_transform()),
                rear.publish(image, time.time_ns(), rear_transform())}
        time.sleep(1 / 5)  # seldom enough for every one to be taken in on a machine that holds the node up
    return last


def test_a_cloud_and_a_depth_camera_fill_one_map(start, peer):
    node = start(TWO, REMAPS, points=None).ready()
    node.line_with("ready:", "/front/points; /camera/depth/image_raw")
    peer.record_node()
    front, rear = peer.camera("/front/points"), peer.depth_camera(depth_images.wall_info())
    front.meet()
    rear.meet()
    last = send_both(front, rear)
    node.line_with("scans of the sensor front are made of /front/points")
    node.line_with("scans of the sensor rear are made of /camera/depth/image_raw")

    def has_both(snapshot):
        places = [cluster.centroid.x for cluster in snapshot.clusters]
        return any(x > 1.9 for x in places) and any(x < -1.9 for x in places)
    peer.clusters.wait("a map with a wall before and one behind", has_both)
    wait_until("the deltas of the last scans", lambda: last <= set(compare.by_stamp(peer.deltas)))
    counts = node.stop()
    assert counts["taken_in"] == front.sent + rear.sent == accounted(counts), counts


def test_a_sensor_that_is_silent_is_named_while_the_other_is_heard(start, peer):
    node = start(TWO, REMAPS, points=None).ready()
    front = peer.camera("/front/points")
    front.meet()
    met = len(node.lines)
    node.line_with("nobody publishes on /camera/depth/image_raw", after=met)
    assert not node.said("nobody publishes on /front/points", after=met)
    node.stop()


@pytest.mark.parametrize("parameters, words", [
    ({"sensors": "[front, front]"}, "a list of 1 to 16 names that differ"),
    ({"sensors": "[a/b]"}, "a list of 1 to 16 names that differ"),
    ({"front.kind": "depth"}, "there is no sensor `front` among sensors (points)"),
    ({"sensors": "[front]", "front.kind": "lidar"}, "front.kind is \"lidar\""),
    ({"sensors": "[front, rear]", "noise_model": "kinect_v1", "rear.noise_model": "none"}, "one map weighs its points in one way"),
])
def test_sensors_that_cannot_be_end_it_with_status_2_and_why(start, parameters, words):
    node = start(parameters)
    assert node.wait(20) == 2 and words in node.lines[-1], node.lines


def test_a_name_that_a_rule_makes_is_not_remapped_by_another(start, peer):
    node = start({"sensors": "[front, rear]"}, {"front": "/rear", "rear": "/back"}, points=None).ready()
    node.line_with("ready:", "/rear; /back")
    wait_until(
        "a reader of each", lambda: [peer.node.count_subscribers(topic) for topic in ("/rear", "/back")] == [1, 1])


def send(camera):
    return camera.publish(clouds.cloud(clouds.wall()), time.time_ns(), clouds.still_transform())


def test_two_nodes_in_two_namespaces_take_a_sensor_each(start, peer):
    cameras, nodes, deltas = {}, {}, {}
    for robot in ("left", "right"):
        arguments = ["-r", f"__ns:=/{robot}"]
        nodes[robot] = start(points=f"/{robot}/points", arguments=arguments).ready(f"/{robot}/cfodi")
        cameras[robot] = peer.camera(f"/{robot}/points")
        deltas[robot] = peer.record(f"/{robot}/cfodi/clusters_delta", SurfaceClusterArray, qos(100))
    for camera in cameras.values():
        camera.meet()
    numbers = {"left": 3, "right": 5}
    for robot, number in numbers.items():
        for _ in range(number):
            until_taken_in(lambda: send(cameras[robot]), deltas[robot])
    for robot, number in numbers.items():
        counts = nodes[robot].stop()
        assert number <= counts["taken_in"] and accounted(counts) <= cameras[robot].sent, counts


def test_two_nodes_of_one_name_both_work(start, peer):
    nodes = [start().ready(), start().ready()]
    deltas = peer.record("/cfodi/clusters_delta", SurfaceClusterArray, qos(100))
    camera = peer.camera()
    wait_until("both nodes", lambda: camera._cloud.get_subscription_count() == 2)
    camera.meet()

    def taken_in_by_both():
        return list(Counter(map(compare.stamp, deltas)).values()).count(2)

    send_until("five scans that both take in", lambda: send(camera), lambda: taken_in_by_both() >= 5, pause=0.3)
    for node in nodes:
        counts = node.stop()
        assert 5 <= counts["taken_in"] and accounted(counts) <= camera.sent, counts


def flows_after(camera, deltas, seconds=20):
    """Sends clouds until one is taken in, with both transforms as a driver does; how long that took."""
    begin, before, cloud = time.monotonic(), len(deltas), clouds.cloud(clouds.wall())
    while len(deltas) == before:
        assert time.monotonic() - begin < seconds, "no scan was taken in"
        camera.publish(cloud, time.time_ns(), clouds.still_transform())
        time.sleep(1 / 30)
    return time.monotonic() - begin


def restarts(start, new_peer, deltas, attempt):
    """How long it takes until data flows after: a first driver, the node, another driver, the node [s]."""
    node, took = start().ready(), []
    for number in range(2):
        driver = new_peer(f"driver_{attempt}_{number}")
        camera = driver.camera()
        took.append(flows_after(camera, deltas))
        node.stop()
        node = start().ready()
        took.append(flows_after(camera, deltas))
        driver.close()
    node.stop()
    return took


@pytest.mark.alone
@pytest.mark.timeout(600)
def test_data_flows_again_within_2_s_whichever_starts_anew(start, new_peer):
    """In one of six attempts, for the machine may be busy; a transform that waits for a heartbeat takes 2.7 s, mostly."""
    watcher = new_peer("watcher")
    deltas = watcher.record("/cfodi/clusters_delta", SurfaceClusterArray, qos(2000))
    for attempt in range(6):
        took = restarts(start, new_peer, deltas, attempt)
        print("data flows again after the driver, the node, the driver, the node [s]:", took)
        if max(took) < 2:
            return
    pytest.fail(f"it took {took} s")
