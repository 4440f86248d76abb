"""The node on Zenoh, beside a real router and a real peer by the conventions of rmw_zenoh."""

import os
import pathlib
import struct
import time

import clouds
import depth_images
import network
import pytest
from cfodi_node import REPOSITORY, accounted, program
from peer import send_until, stamp, until_taken_in, wait_until
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from zenoh_ros2_sdk.qos import QosDurability, QosProfile

import zenoh_peer
from zenoh_peer import ARRAY, CLOUD, COMPRESSED, IMAGE, INFO, MARKERS, TF

HASHES = REPOSITORY / "src" / "node" / "zenoh" / "type_hashes.txt"
BINARY = pathlib.Path(os.environ.get("CFODI_SECURED") or REPOSITORY / "target" / "secured") / "cfodi"
LATCHED = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
ZENOH = {"RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}


@pytest.fixture(scope="module")
def own_network():
    """One for all of these tests: Zenoh's threads live as long as Python, in the network that they began in."""
    network.own_network()


@pytest.fixture(scope="module")
def definitions(tmp_path_factory):
    return zenoh_peer.definitions(tmp_path_factory.mktemp("definitions"))


@pytest.fixture
def new_router(own_network):
    routers = []

    def start():
        routers.append(zenoh_peer.Router())
        return routers[-1]

    yield start
    for router in routers:
        router.end()


@pytest.fixture
def router(new_router):
    return new_router()


@pytest.fixture
def robot(router, definitions):
    robot = zenoh_peer.Robot(definitions)
    yield robot
    robot.close()


@pytest.fixture
def zenoh_node(start):
    def begin(*arguments, environment=None, **more):
        return start(*arguments, binary=BINARY, environment=ZENOH | (environment or {}), **more)
    return begin


def has_wall(snapshot):
    return any(abs(cluster.centroid.x - 2.04) < 0.05 for cluster in snapshot.clusters)


def assert_taken_in(counts, sent):
    """Each is accounted for, but a few that were sent while the two sides went over from the router to a link of their own; on a
    busy machine Zenoh and the node may pass over some, and of what comes none is skipped."""
    assert sent - 2 <= accounted(counts) <= sent and not any(counts["skipped"].values()), counts
    assert counts["taken_in"] >= sent / 2, counts


def drive_until_all_come_out(robot, deltas, count=20, attempts=5):
    """One delta for each cloud of a drive, their numbers in a row; driven anew, more slowly, where a busy machine let one go."""
    for attempt in range(attempts):
        begin = time.time_ns()
        robot.drive(count=count, rate=20 / (attempt + 1))
        end = time.monotonic() + 5
        while time.monotonic() < end:
            numbers = [delta.sequence for delta in deltas if stamp(delta) >= begin]
            if numbers and numbers == list(range(numbers[0], numbers[0] + count)):
                return
            time.sleep(0.05)
    raise AssertionError(f"{attempts} drives of {count} clouds, and of the last came deltas {numbers}")


def test_clouds_come_in_and_clusters_deltas_and_markers_go_out(zenoh_node, robot):
    node = zenoh_node().ready()
    clusters, deltas = robot.read("/cfodi/clusters", ARRAY), robot.read("/cfodi/clusters_delta", ARRAY)
    markers = robot.read("/cfodi/markers", MARKERS)
    robot.meet()
    drive_until_all_come_out(robot, deltas)
    clusters.wait("a map with a wall", has_wall)
    markers.wait("markers of a surface", lambda array: any(len(marker.points) > 0 for marker in array.markers))
    late = robot.read("/cfodi/clusters", ARRAY, qos=LATCHED)
    assert has_wall(late.wait("what is kept for late readers"))
    counts = node.stop()
    assert_taken_in(counts, robot.sent)


def test_a_name_that_a_rule_makes_is_not_remapped_by_another(zenoh_node, robot):
    zenoh_node({"sensors": "[front, rear]"}, {"front": "/rear", "rear": "/back"}, points=None).ready()
    robot.meet()
    wait_until("a reader of each", lambda: robot.are_read("/rear", "/back") == (True, True))


def show_wall(robot, topic, message_type, image, count=20):
    """Depth images, each with its camera and its transforms; returns the last stamp."""
    info = depth_images.wall_info()
    for _ in range(count):
        now = time.time_ns()
        robot.publish_transforms(now)
        robot.publish("/camera/depth/camera_info", INFO, clouds.stamped(info, clouds.CLOUD_STAMP, now))
        time.sleep(0.02)
        robot.publish_scan(topic, message_type, image, now)
        time.sleep(0.03)
    return now


@pytest.mark.parametrize("form, suffix, message_type", [
    (depth_images.image, "", IMAGE), (depth_images.compressed, "/compressedDepth", COMPRESSED)], ids=["raw", "compressed"])
def test_depth_images_with_their_camera_come_in(form, suffix, message_type, zenoh_node, robot):
    topic = "/camera/depth/image_raw" + suffix
    remaps = {"depth/image": "/camera/depth/image_raw", "depth/camera_info": "/camera/depth/camera_info"}
    node = zenoh_node(remaps=remaps, points=None).ready()
    clusters, deltas = robot.read("/cfodi/clusters", ARRAY), robot.read("/cfodi/clusters_delta", ARRAY)
    for offered in {(topic, message_type), ("/camera/depth/image_raw/compressedDepth", COMPRESSED)}:
        robot.publisher(*offered)
    robot.meet()
    wait_until("a reader of the images", lambda: robot.are_read(topic) == (True,))
    time.sleep(2)
    if not suffix:
        wait_until("a look", lambda: robot.are_read(topic, topic + "/compressedDepth") == (True, False))
    image = form(depth_images.wall())
    show_wall(robot, topic, message_type, image)
    clusters.wait("a map with a wall", has_wall)
    until_taken_in(lambda: show_wall(robot, topic, message_type, image, count=1), deltas)
    assert_taken_in(node.stop(), robot.sent)


def test_compressed_images_are_read_no_more_once_raw_ones_come(zenoh_node, robot):
    """A Kinect that is plugged in long after its driver has offered both."""
    topic, packed = "/camera/depth/image_raw", "/camera/depth/image_raw/compressedDepth"
    remaps = {"depth/image": topic, "depth/camera_info": "/camera/depth/camera_info"}
    zenoh_node(remaps=remaps, points=None).ready()
    for offered in ((topic, IMAGE), (packed, COMPRESSED)):
        robot.publisher(*offered)
    robot.meet()
    wait_until("a reader of the compressed images", lambda: robot.are_read(topic, packed) == (True, True), 60)
    show_wall(robot, topic, IMAGE, depth_images.image(depth_images.wall()))
    wait_until("nobody to pack a PNG for", lambda: robot.are_read(topic, packed) == (True, False), 60)


def test_static_transforms_from_before_the_node_are_asked_for(zenoh_node, robot):
    publisher = robot.publisher("/tf_static", TF)
    kept = robot.latch(publisher, clouds.static_transform())
    node = zenoh_node().ready()
    clusters, deltas = robot.read("/cfodi/clusters", ARRAY), robot.read("/cfodi/clusters_delta", ARRAY)
    robot.meet()
    still = [clouds.still_transform()]
    robot.drive(transforms=still)
    clusters.wait("a map with a wall", has_wall)
    until_taken_in(lambda: robot.drive(count=1, transforms=still), deltas)
    assert_taken_in(node.stop(), robot.sent)
    kept.undeclare()


def test_reset_is_called_and_answered(zenoh_node, robot):
    node = zenoh_node().ready()
    clusters = robot.read("/cfodi/clusters", ARRAY)
    robot.meet()
    robot.drive()
    session = clusters.wait("a map with a wall", has_wall).session_id
    answer = robot.trigger("/cfodi/reset")
    assert answer.success, answer
    clusters.wait("another session", lambda snapshot: snapshot.session_id != session and not len(snapshot.clusters))
    answer = robot.trigger("/cfodi/save")
    assert not answer.success and "snapshot_path" in answer.message
    node.stop()


def test_two_robots_on_one_router_do_not_hear_each_other(zenoh_node, robot):
    nodes = {}
    for name in ("a", "b"):
        nodes[name] = zenoh_node(points="points", arguments=["-r", f"__ns:=/{name}"]).ready(f"/{name}/cfodi")
    maps = {name: robot.read(f"/{name}/cfodi/clusters", ARRAY) for name in nodes}
    deltas = {name: robot.read(f"/{name}/cfodi/clusters_delta", ARRAY) for name in nodes}
    robot.meet()

    def drive(name, count):
        """Until there is a map; returns how many clouds that took."""
        before, topic = robot.sent, f"/{name}/points"
        robot.drive(topic, count)
        maps[name].wait(f"a map of {name}", has_wall)
        until_taken_in(lambda: robot.drive(topic, count=1), deltas[name])
        return robot.sent - before

    sent = {"a": drive("a", 12)}
    robot.trigger("/b/cfodi/reset")
    sent["b"] = drive("b", 7)
    for name, node in nodes.items():
        assert_taken_in(node.stop(), sent[name])
    assert len({snapshot.session_id for snapshot in maps["a"]}) == 1


def test_a_router_that_comes_late_and_one_that_starts_anew_are_found(zenoh_node, new_router, definitions):
    node = zenoh_node().ready()
    node.line_with("no Zenoh router is there yet")
    for number in range(2):
        router = new_router()
        node.line_with("a Zenoh router is there")
        robot = zenoh_peer.Robot(definitions)
        try:
            deltas = robot.read("/cfodi/clusters_delta", ARRAY)
            send_until(f"a delta by router {number}", lambda: robot.drive(count=1), lambda: deltas)
        finally:
            robot.close()
        router.end()
        node.line_with("the Zenoh router has gone")
        node.lines.clear()
    node.process.terminate()
    assert node.wait() == 0


def test_what_is_no_message_is_counted_and_the_next_good_one_is_taken_in(zenoh_node, robot):
    node = zenoh_node().ready()
    cloud = clouds.cloud(clouds.wall())
    attachment = struct.pack("<qqB16s", 2**63 - 1, -1, 16, b"\xff" * 16)
    bad = [b"", b"\0\1\0\0", b"\xff" * 100, cloud[:-1], bytes(4) + b"\xff" * 60]
    robot.meet()
    for data in bad:
        for beside in (None, b"", b"\xff" * 33, attachment, b"\0" * 2**16):
            robot.put("/camera/depth/points", CLOUD, data, beside)
            robot.put("/tf", TF, data, beside)
            robot.put("/tf_static", TF, data, beside)
            time.sleep(0.1)
    session = robot.session.session
    for data in bad:
        key = "0/cfodi/reset/std_srvs::srv::dds_::Trigger_/any"
        list(session.get(key, payload=data, timeout=0.3))
        list(session.get(key, payload=data, attachment=attachment, timeout=0.3))
    node.line_with("/tf_static")
    clusters, deltas = robot.read("/cfodi/clusters", ARRAY), robot.read("/cfodi/clusters_delta", ARRAY)
    robot.drive()
    clusters.wait("a map with a wall", has_wall)
    until_taken_in(lambda: robot.drive(count=1), deltas)
    counts = node.stop()
    assert counts["skipped"].pop("undecodable") == 25, counts
    assert_taken_in(counts, robot.sent)


def test_a_flood_is_bounded_and_what_is_lost_by_it_is_counted(zenoh_node, robot):
    node = zenoh_node().ready()
    deltas = robot.read("/cfodi/clusters_delta", ARRAY)
    robot.meet()
    large = clouds.cloud(clouds.wall(side=700))
    robot.drive(count=5)
    before = memory(node)
    for _ in range(100):
        robot.publish("/camera/depth/points", CLOUD, clouds.stamped(large, clouds.CLOUD_STAMP, time.time_ns()))
    robot.drive(count=5)
    until_taken_in(lambda: robot.drive(count=1), deltas)
    most = memory(node)
    counts = node.stop()
    print("memory [MB]", before, most, counts)
    assert robot.sent + 98 <= accounted(counts) <= robot.sent + 100, counts
    assert most - before < 400


def test_calls_that_come_faster_than_they_are_read_are_said(zenoh_node, robot):
    node = zenoh_node().ready()
    session = robot.session.session
    attachment = struct.pack("<qqB16s", 1, 1, 16, b"\1" * 16)
    for _ in range(5000):
        session.get("0/cfodi/reset/std_srvs::srv::dds_::Trigger_/any", payload=b"\0\1\0\0\0", attachment=attachment, timeout=5)
    node.line_with("~/reset", "came faster than they were read")
    assert robot.trigger("/cfodi/reset").success
    node.stop()


def memory(node):
    """The most that it had (MB)."""
    status = pathlib.Path(f"/proc/{node.process.pid}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024


def test_parameters_are_shown_and_changed_as_over_dds(zenoh_node, robot):
    node = zenoh_node().ready()
    robot.meet()
    listed = robot.call("/cfodi/list_parameters", ListParameters, ListParameters.Request())
    assert "voxel_size" in listed.result.names
    got = robot.call("/cfodi/get_parameters", GetParameters, GetParameters.Request(names=["voxel_size"]))
    assert got.values == [ParameterValue(type=3, double_value=0.08)]
    changes = robot.read("/parameter_events", "rcl_interfaces/msg/ParameterEvent")
    wait_until("its token", lambda: robot.are_read("/parameter_events") == (True,))
    time.sleep(1)
    for number, successful in ((0.5, True), (61.0, False)):
        parameter = Parameter(name="tf_timeout", value=ParameterValue(type=3, double_value=number))
        wanted = SetParameters.Request(parameters=[parameter])
        [result] = robot.call("/cfodi/set_parameters", SetParameters, wanted).results
        assert result.successful is successful, result
    assert changes.wait("what has changed").changed_parameters[0].name == "tf_timeout"
    node.line_with("tf_timeout is 0.5 from now on")
    node.stop()


def test_who_publishes_something_else_is_named(zenoh_node, robot):
    node = zenoh_node().ready()
    robot.publisher("/other/points", CLOUD)
    node.line_with("/other/points", "-r points:=/other/points")
    node.stop()


@pytest.mark.parametrize("environment, words", [
    ({"RMW_IMPLEMENTATION": "rmw_zenoh"}, "it must be `rmw_zenoh_cpp`, or for DDS one of rmw_fastrtps_cpp"),
    (ZENOH | {"ROS_SECURITY_ENABLE": "true", "ROS_SECURITY_STRATEGY": "Enforce"}, "gives to DDS alone"),
    (ZENOH | {"ZENOH_CONFIG_OVERRIDE": "mode"}, "ZENOH_CONFIG_OVERRIDE is \"mode\""),
    (ZENOH | {"ZENOH_SESSION_CONFIG_URI": "/no/such.json5"}, "ZENOH_SESSION_CONFIG_URI is \"/no/such.json5\""),
    (ZENOH | {"ZENOH_ROUTER_CHECK_ATTEMPTS": "one"}, "ZENOH_ROUTER_CHECK_ATTEMPTS is \"one\""),
])
def test_an_environment_that_cannot_be_ends_it_with_status_2_and_why(start, environment, words):
    node = start(binary=BINARY, environment=environment)
    assert node.wait(20) == 2 and words in node.lines[-1], node.lines


def test_without_the_feature_it_refuses_where_its_peers_would_not_hear_it(start):
    node = start(binary=program(), environment=ZENOH)
    assert node.wait(20) == 2 and "--features zenoh" in node.lines[-1], node.lines


def test_the_committed_hashes_are_those_that_ros_2_computes():
    committed = [line.split(" ") for line in HASHES.read_text().splitlines()]
    assert committed == [[name, zenoh_peer.installed_hash(name)] for name, _ in committed]
