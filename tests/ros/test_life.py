"""How the node starts, refuses, ends, and what those who come late or wait get."""

import signal
import subprocess
import time

import pytest
from cfodi_msgs.msg import SurfaceClusterArray
from cfodi_node import program
from peer import qos, wait_until
from std_srvs.srv import Trigger
from test_inputs import begin, take_in
from test_introspection import node_names
from visualization_msgs.msg import Marker, MarkerArray

REFUSED = [
    ("voxel_size", "-1.5", ["must be"]),
    ("voxel_size", "wide", ["must be"]),
    ("min_points", "0", ["must be"]),
    ("depth", "9", ["must be"]),
    ("max_normal_angle", "2.5", ["must be"]),
    ("optical", "perhaps", ["must be", "auto", "yes", "no"]),
    ("publish_rate", "0.0", ["must be"]),
    ("network_interfaces", "[lo0]", ["must be"]),
    ("network_interfaces", "[0.0.0.0]", ["must be"]),
    ("mode", "fast", ["must be", "consistent", "paper"]),
    ("noise_model", "kinect_v2", ["must be", "kinect_v1", "none"]),
    ("pose_sigma", "-0.1", ["must be", "from 0 to 1 m"]),
    ("pose_sigma", "0.1", ["must be", "at most voxel_size, which is 0.08 m"]),
    ("clearing", "1", ["must be"]),
    ("max_voxels", "-1", ["must be"]),
    ("keep_radius", "-1.5", ["must be"]),
]


@pytest.mark.parametrize("name, value, says", REFUSED)
def test_an_impossible_parameter_ends_it_with_status_2_and_says_why(name, value, says, start):
    node = start({name: value})
    assert node.wait() == 2
    lines = [line for line in node.lines if all(part in line for part in (name, value.strip("[]"), *says))]
    assert lines, f"no line with {name}, {value}, {says}:\n" + "\n".join(node.lines)
    assert not any("ready:" in line for line in node.lines)


@pytest.mark.parametrize("name, value", [("clearing", "true"), ("max_voxels", "9"), ("keep_radius", "2.5")])
def test_the_papers_mode_is_not_told_to_forget(name, value, start):
    node = start({"mode": "paper", name: value})
    assert node.wait() == 2
    assert [line for line in node.lines if all(part in line for part in (name, value, "`paper`"))], "\n".join(node.lines)


@pytest.mark.parametrize("name, nearest", [("voxel_sise", "voxel_size"), ("min_vicinty", "min_vicinity")])
def test_an_unknown_parameter_ends_it_with_status_2_and_the_nearest_right_name(name, nearest, start):
    node = start({name: 1})
    assert node.wait() == 2
    assert [line for line in node.lines if name in line and nearest in line], "\n".join(node.lines)


@pytest.mark.parametrize("ending, domain", [(signal.SIGINT, 0), (signal.SIGTERM, 7)])
def test_sigint_and_sigterm_end_it_with_status_0_and_it_leaves_the_graph(ending, domain, start, new_peer):
    """With all that it had, and at once: who waits for its services would call into the void, and a robot would count its topics."""
    peer = new_peer(domain=domain)
    save = peer.node.create_client(Trigger, "/cfodi/save")
    node = start(environment={"ROS_DOMAIN_ID": str(domain)}).ready()
    wait_until("the node in the graph", lambda: "/cfodi" in node_names(peer))
    wait_until("its topics and services", lambda: peer.node.count_publishers("/cfodi/clusters") and save.service_is_ready())
    node.stop(ending)
    wait_until("the node gone", lambda: "/cfodi" not in node_names(peer), 5)
    wait_until("its topics gone", lambda: not peer.node.count_publishers("/cfodi/clusters"), 5)
    wait_until("its services gone", lambda: not save.service_is_ready(), 5)


def test_the_robot_of_a_demo_leaves_the_graph_with_it(peer, tmp_path):
    """Beside RViz it would else stand in the graph when the next one begins."""
    with subprocess.Popen([program(), "demo", "--seconds=5", "--out", tmp_path]) as demo:
        wait_until("the robot in the graph", lambda: "/simulated_robot" in node_names(peer))
        wait_until("its transforms", lambda: peer.node.count_publishers("/tf"))
        assert demo.wait(120) == 0
    wait_until("the robot gone", lambda: "/simulated_robot" not in node_names(peer), 5)
    wait_until("its transforms gone", lambda: not peer.node.count_publishers("/tf"), 5)


def test_who_joins_late_gets_the_snapshot_at_once(start, peer, new_peer):
    _, camera = begin(start, peer, publish_rate=0.04)
    take_in(camera, peer.deltas)
    peer.clusters.wait("a snapshot of the scan", lambda m: m.sequence == 1, timeout=45)
    seen = len(peer.clusters)
    late = new_peer("late").record("/cfodi/clusters", SurfaceClusterArray, qos(1, latched=True))
    # RustDDS drops what a depth of 1 has no place for every 6 s, not at once: older ones of the session may come first.
    latched = late.wait("the latched snapshot of the scan", lambda m: m.sequence == 1, timeout=20)
    assert latched.clusters
    assert len(peer.clusters) == seen, "it was a periodic snapshot, which proves nothing"


def test_a_late_reader_is_sent_older_maps_of_the_session_at_once_though_it_is_volatile(start, peer, new_peer):
    """They are dropped every 6 s, so that one of some readers may come just then."""
    _, camera = begin(start, peer, publish_rate=10.0)
    late = new_peer("late")
    wait_until("the node found", lambda: late.node.count_publishers("/cfodi/clusters"))
    for _ in range(4):
        for _ in range(5):
            newest = take_in(camera, peer.deltas).sequence
            peer.clusters.wait("its map", lambda m: m.sequence == newest)
        maps = late.record("/cfodi/clusters", SurfaceClusterArray, qos(1))
        maps.wait("the newest map", lambda m: m.sequence == newest)
        came = [message.sequence for message in maps]
        assert came == sorted(came)
        if came[0] < newest:
            return
    pytest.fail(f"only the newest map came: {came}, {newest}")


@pytest.mark.alone
def test_a_reader_of_markers_that_was_there_before_the_node_makes_no_start_an_error(start, peer):
    """It is told of the node's topics and acknowledges markers after as much as a second, in which more of them were made than are
    kept for it."""
    markers = peer.record("/cfodi/markers", MarkerArray, qos(1, latched=True))
    for _ in range(6):
        node, seen = start({"publish_rate": 8.0}).ready(), len(markers)
        markers.wait("its markers", after=seen)
        time.sleep(2)
        node.stop()
        assert not node.said("ERROR"), "\n".join(node.lines)


def test_who_joins_after_a_reset_gets_no_map_of_the_session_before(start, peer, new_peer):
    _, camera = begin(start, peer)
    late = new_peer("late")  # knows the node by then: it reads at once, and not when what was replaced is dropped anyway
    wait_until("the node found", lambda: late.node.count_publishers("/cfodi/markers"))
    before = take_in(camera, peer.deltas).session_id
    peer.clusters.wait("a map to be forgotten", lambda m: m.session_id == before and m.clusters)
    peer.markers.wait("its markers", shows)
    assert peer.call(Trigger, "/cfodi/reset", Trigger.Request()).success
    session = peer.clusters.wait("the map of a new session", lambda m: m.session_id != before).session_id
    maps = late.record("/cfodi/clusters", SurfaceClusterArray, qos(100, latched=True))
    markers = late.record("/cfodi/markers", MarkerArray, qos(100, latched=True))
    wait_until("maps and markers", lambda: len(maps) > 1 and len(markers) > 1)
    assert {message.session_id for message in maps} == {session}
    assert not any(shows(message) for message in markers)


def shows(markers):
    return any(marker.action == Marker.ADD for marker in markers.markers)


@pytest.mark.alone
def test_snapshots_go_out_at_publish_rate_even_when_no_scan_came(start, peer):
    start({"publish_rate": 5.0}).ready()
    peer.record_node()
    peer.clusters.wait("a first snapshot")
    rates = []
    for _ in range(3):  # a machine may be busy for some seconds
        before, begin = len(peer.clusters), time.monotonic()
        time.sleep(4)
        rates.append((len(peer.clusters) - before) / (time.monotonic() - begin))
        if 4 <= rates[-1] <= 6:
            break
    assert 4 <= rates[-1] <= 6, rates
    assert peer.clusters[-1].sequence == 0 and not peer.clusters[-1].clusters
    assert len({message.session_id for message in peer.clusters}) == 1
