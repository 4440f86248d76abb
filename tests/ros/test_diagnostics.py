"""What the node says of itself: `/diagnostics` once a second, its log on `/rosout`."""

import time

import clouds
import pytest
from cfodi_msgs.msg import SurfaceClusterArray
from diagnostic_msgs.msg import DiagnosticArray
from peer import qos, send_until
from rcl_interfaces.msg import Log

OK, WARN, ERROR = (bytes([level]) for level in range(3))
STOCK = {"receive_buffer": 212992}  # bytes, what a stock kernel grants: where less is granted than asked for, the network is no OK


@pytest.fixture
def reports(peer):
    return peer.record("/diagnostics", DiagnosticArray, qos(100))


@pytest.fixture
def log(peer):
    return peer.record("/rosout", Log, qos(100, latched=True))


def part(report, name):
    return next(status for status in report.status if status.name == f"cfodi: {name}")


def values(status):
    return {value.key: value.value for value in status.values}


def says(report, name, level, *words):
    """Whether this part of it has this level and says these words."""
    status = part(report, name)
    return status.level == level and all(word in status.message for word in words)


def wait_for(reports, name, level, *words, after=None):
    """The first such report from now on (or after so many): its part, and the figures of that."""
    report = reports.wait(f"{name} at {level} with {words}", lambda report: says(report, name, level, *words),
                          after=len(reports) if after is None else after)
    return part(report, name), values(part(report, name))


def send(camera, count=60, transform=clouds.still_transform, ahead_ns=0, frame_id=clouds.OPTICAL):
    cloud = clouds.cloud(clouds.wall(), frame_id=frame_id)
    for _ in range(count):
        camera.publish(cloud, time.time_ns() + ahead_ns, transform and transform())
        time.sleep(1 / 20)


def test_a_node_that_works_says_so_with_its_figures(start, peer, reports, log):
    node = start(STOCK).ready()
    camera = peer.camera()
    camera.meet()

    def is_of_work(report):
        engine, rate = part(report, "engine"), float(values(part(report, "sensor points"))["rate [Hz]"])
        return engine.message[0] != "0" and 5 < rate < 40 and values(part(report, "map")).get("clusters") == "1"

    report = send_until("a report while clouds come, of a map with a cluster", lambda: send(camera, 1),
                        lambda: next(filter(is_of_work, reports), None), pause=0)
    assert {status.name for status in report.status} == {
        f"cfodi: {name}" for name in ("sensor points", "transforms", "engine", "map", "network")}
    sensor = part(report, "sensor points")
    assert sensor.level == OK and sensor.message.endswith("scans/s on /camera/depth/points"), sensor
    assert abs(float(values(sensor)["age of the newest [s]"])) < 5
    assert abs(float(values(sensor)["age of the newest taken in [s]"])) < 5 and int(values(sensor)["taken in"]) > 0
    figures = values(part(report, "engine"))
    assert 0 < float(figures["engine, median [ms]"]) <= float(figures["engine, longest [ms]"])
    assert int(figures["taken in in all"]) > 0
    assert part(report, "transforms").level == OK and part(report, "network").level == OK
    of_map = values(part(report, "map"))
    assert int(of_map["scans taken in since these figures"]) >= 0
    assert int(of_map["dense voxels"]) > 100 and 5 < float(of_map["memory [MB]"]) < 2000
    ready = log.wait("the line `ready` on /rosout", lambda line: "ready:" in line.msg)
    assert (ready.name, ready.level) == ("cfodi", 20) and ready.file.endswith(".rs") and ready.stamp.sec > 0
    node.stop()


def test_what_is_not_right_is_said_by_its_part(start, peer, reports, log):
    node = start().ready()
    wait_for(reports, "sensor points", ERROR, "nobody publishes on /camera/depth/points")
    camera = peer.camera()
    camera.meet()
    before = len(reports)
    send(camera, 40, transform=None, frame_id="nowhere")
    _, figures = wait_for(reports, "transforms", ERROR, "nowhere", "map", after=before)
    assert int(figures["given up"]) > 0
    _, of_sensor = wait_for(reports, "sensor points", WARN, "none of its scans is taken into the map", "nowhere", after=before)
    assert int(of_sensor["taken in"]) == 0 and "age of the newest taken in [s]" not in of_sensor
    warned = log.wait("the same on /rosout", lambda line: line.level == 30 and "nowhere" in line.msg)
    assert "frames seen" in warned.msg
    before = len(reports)
    send(camera, 40, ahead_ns=3600 * 10**9)
    wait_for(reports, "sensor points", WARN, "s ahead of the clock", after=before)
    node.line_with("ahead of the clock")
    node.stop()


def test_transforms_that_are_refused_are_a_warning_with_the_reason(start, peer, reports):
    node = start().ready()
    camera = peer.camera()
    camera.meet()
    before = len(reports)
    send(camera, 1)
    # Of odometry that was never initialised.
    send(camera, transform=lambda: clouds.transform("map", "camera_link", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0)))
    report = reports.wait("transforms at WARN or worse with `norm 0`", lambda report: (
        part(report, "transforms").level >= WARN and "norm 0" in part(report, "transforms").message), after=before)
    transforms = part(report, "transforms")
    assert "; the last: transform camera_link to map" in transforms.message
    assert int(values(transforms)["refused"]) > 0
    node.stop()


def test_scans_without_a_stamp_are_refused_and_that_is_said(start, peer, reports):
    node = start().ready()
    camera = peer.camera()
    camera.meet()
    cloud = clouds.cloud(clouds.wall())

    def are_there():
        words = "were lost or cannot be used", "its stamp is zero"
        is_reported = any(says(report, "sensor points", ERROR, *words) for report in reports)
        return is_reported and node.said("a scan of /camera/depth/points was skipped: its stamp is zero")

    # It is an error after three seconds of nothing else.
    send_until("an error and a line of it", lambda: camera.publish(cloud, 0, clouds.still_transform()), are_there, pause=1 / 20)
    counts = node.stop()
    assert counts["taken_in"] == 0 and counts["skipped"]["no_stamp"] == counts["received"] > 0, counts


def test_another_node_of_its_name_is_told_of_while_it_is_there(start, reports):
    nodes = [start(STOCK).ready(), start(STOCK).ready()]
    for node in nodes:
        node.line_with("nodes of the name /cfodi beside this one: 1")
    nodes[1].process.kill()
    # RustDDS forgets who is silent after up to 50 s.
    reports.wait("no namesake, once the one that was killed is forgotten", lambda report: part(report, "network").level == OK,
                 timeout=120, after=len(reports))
    nodes[0].stop()


def test_a_reader_that_asks_for_more_than_is_offered_is_named(start, peer, reports, log):
    node = start().ready()
    peer.record("/cfodi/clusters_delta", SurfaceClusterArray, qos(10, latched=True))
    said, _ = wait_for(reports, "network", WARN, "/cfodi/clusters_delta", "transient local", "volatile")
    assert "gets nothing" in said.message
    log.wait("the same on /rosout", lambda line: "transient local" in line.msg and line.level == 30)
    node.stop()


def test_a_socket_buffer_that_the_system_cuts_short_is_said(start, reports):
    node = start({"receive_buffer": 2**30}).ready()
    _, figures = wait_for(reports, "network", WARN, "sudo sysctl -w net.core.rmem_max=1073741824")
    assert 0 < int(figures["socket receive buffer [bytes]"]) < 2**30
    node.stop()
