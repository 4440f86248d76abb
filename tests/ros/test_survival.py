"""What goes wrong on a robot, and what is expected of the node then: each test says it first."""

import contextlib
import functools
import os
import pathlib
import re
import shutil
import subprocess
import sys
import time

import compare
import cpp
import pytest
from cfodi_node import REPOSITORY, accounted, skipped
from faults import Driver, hogs, no_network, stall, stopped
from follow import follow
from left_out import leave_out
from network import other_machine
from peer import wait_until

STALL = 5  # s
HASTE = 200  # Hz
MOST_DELTAS = 1024  # that the node keeps for a reader that acknowledges none
SENT_UNSEEN = 3  # scans that a killed driver may have sent without saying so, or said and not sent to the end


@pytest.fixture
def drive(own_network):
    """Starts a driver; none is left at the end of the test."""
    started = []

    def drive(*arguments, **more):
        started.append(Driver(*arguments, **more))
        return started[-1]

    yield drive
    for driver in started:
        driver.kill()


def begin(start, peer, drive, *arguments, **parameters):
    """The node, recorded, and a driver whose scans it takes in."""
    node = start(parameters).ready()
    peer.record_node()
    driver = drive(*arguments)
    peer.deltas.wait("the delta of a first scan", timeout=60)
    return node, driver


def flows_again(peer, since):
    """Ten deltas of scans that were made after `since` (ns)."""
    for _ in range(10):
        since = compare.stamp(peer.deltas.wait(
            f"the delta of a scan after {since}", lambda m: compare.stamp(m) > since, timeout=60))


def is_there_once(peer):
    """What the node was on a network that it has left does not stay beside it."""
    wait_until("one node", lambda: peer.node.count_publishers("/cfodi/clusters") == 1, 5)


def one_map(peer, counts, gaps=0):
    """One session, no delta lost but in so many gaps, and the deltas lead from each snapshot to the next."""
    peer.clusters.wait("the last snapshot", lambda m: m.sequence == counts["taken_in"])
    if not gaps:
        wait_until("every delta", lambda: len(peer.deltas) >= counts["taken_in"])
        assert len(peer.deltas) == counts["taken_in"]
    assert len({message.session_id for message in [*peer.deltas, *peer.clusters]}) == 1
    followed = follow(peer.clusters, peer.deltas)
    assert not followed.violations, followed.violations[:10]
    assert followed.gaps <= gaps and followed.compared >= 2 and followed.sessions == 1
    assert peer.clusters[len(peer.clusters) - 1].clusters


def stop(node, driver):
    """Ends both when the driver has sent its last: every scan is in the counts, which are returned."""
    sent = driver.finish()
    counts = node.stop()
    print(len(sent), counts)
    add_up(counts)
    assert accounted(counts) == len(sent), counts
    return counts


def add_up(counts):
    assert counts["received"] == counts["taken_in"] + counts["replaced"] + skipped(counts), counts


def test_a_driver_that_is_killed_and_restarted_goes_on_in_the_same_map(start, peer, drive):
    """Killed with SIGKILL, the driver says goodbye to nobody. The node keeps its map, its session and its ids, says after
    three seconds that nothing comes, and takes in what the driver's successor sends as soon as the two have met. Of what
    was sent only what the successor sent before that is not accounted for, and a scan that was cut off."""
    node, driver = begin(start, peer, drive)
    driver.sends(30)
    before = driver.kill()
    ids = {cluster.id for cluster in peer.clusters.wait("a snapshot with a cluster", lambda m: m.clusters).clusters}
    quiet = node.line_with("no cloud has come for", timeout=60)
    assert int(re.search(r"come for (\d+) s", quiet)[1]) >= 3, quiet
    successor = drive("--at-once")
    successor.sends()
    flows_again(peer, successor.sent[0])
    successor.sends(30)
    after = successor.finish()
    counts = node.stop()
    add_up(counts)
    met = next(i for i, stamp in enumerate(after) if stamp in compare.by_stamp(peer.deltas))
    assert len(before) + len(after) - met - SENT_UNSEEN <= accounted(counts) <= len(before) + len(after) + 1, counts
    one_map(peer, counts)
    assert ids <= {cluster.id for cluster in peer.clusters[len(peer.clusters) - 1].clusters}


def test_a_node_that_is_killed_and_restarted_beside_a_driver_begins_a_session(start, peer, drive):
    """Killed with SIGKILL, the node loses its map (unless it saved it). Restarted, it meets the driver, its transforms and
    its readers anew without anyone's help, and begins under a session id that is newer than the one before."""
    node, driver = begin(start, peer, drive)
    session = peer.deltas[0].session_id
    node.process.kill()
    node.process.wait()
    again = start().ready()
    delta = peer.deltas.wait("a delta of the new session", lambda m: m.session_id > session, timeout=60)
    snapshot = peer.clusters.wait("a snapshot of it", lambda m: m.session_id == delta.session_id and m.clusters, timeout=60)
    assert snapshot.clusters[0].id == 1
    driver.sends(30)
    driver.finish()
    add_up(again.stop())
    assert len({message.session_id for message in peer.deltas}) == 2


@pytest.mark.parametrize("seconds", [0.5, STALL])
def test_when_the_network_comes_back_the_scans_do_in_the_same_map(seconds, start, peer, drive):
    """While the interface is down nothing arrives, and the node neither ends nor forgets. When it is up again, scans come
    without a restart of anyone, into the same map; those sent in between are counted as lost, and no others."""
    node, driver = begin(start, peer, drive)
    driver.sends(30)
    with no_network():
        down = time.time_ns()
        time.sleep(seconds)
        up = time.time_ns()
    flows_again(peer, up)
    driver.sends(30)
    counts = stop(node, driver)
    assert counts["lost"] + skipped(counts) <= sum(down - 10**8 <= stamp <= up + 10**9 for stamp in driver.sent), counts
    one_map(peer, counts)


@pytest.mark.alone
def test_a_burst_at_90_hz_costs_what_is_counted_and_nothing_else(start, peer, drive, large_buffers):
    """Three times a Kinect's rate in clouds of 2.5 MB: what the engine has no time for is counted as replaced, what the
    network had no room for as lost. Every scan is one of taken in, replaced, lost or skipped, and when the burst is over
    nothing of it is left behind."""
    node, driver = begin(start, peer, drive, "--scans=room", "--size", 480, 320, voxel_size=0.02, max_voxels=200000)
    driver.say("rate 90")
    driver.sends(180)
    driver.say("rate 10")
    driver.sends(20)
    over = time.time_ns()
    flows_again(peer, over)
    counts = stop(node, driver)
    one_map(peer, counts)


@pytest.mark.alone
def test_beside_two_hogs_on_the_cores_every_scan_is_taken_in_or_counted(start, peer, drive):
    """Two processes that take all the time they get leave the node a third or so of a core. It goes on, and what it had
    no time for is counted."""
    node, driver = begin(start, peer, drive)
    with hogs():
        driver.sends(150)
        flows_again(peer, time.time_ns())
    counts = stop(node, driver)
    one_map(peer, counts)


def test_a_node_that_stalls_for_5_s_goes_on_in_the_same_map(start, peer, drive):
    """A node that got no time for five seconds goes on in the same session. Linux interrupts waits of a process that was
    stopped and continued, at which the middleware's threads may end: then the node joins the network anew and says so.
    Scans that were sent until it is heard again are lost and counted so; readers miss deltas once and go on from a
    snapshot."""
    node, driver = begin(start, peer, drive)
    driver.sends(30)
    stall(node.process, STALL)
    flows_again(peer, time.time_ns())
    is_there_once(peer)
    driver.sends(30)
    counts = stop(node, driver)
    assert not any("JumpedBack" in line for line in node.lines), "transforms were taken in a wrong order"
    one_map(peer, counts, gaps=1)


def test_where_the_clock_is_set_back_scans_come_again_soon_in_the_same_map(start, peer, drive, tmp_path):
    """The clock of the node's machine goes back by ten minutes, that of the sensors' does not. RustDDS would hand on no cloud
    for as long: the node notices, joins the network anew once it has been there for 5 s, and says why. As after a stall, scans
    until it is heard again are counted as lost, and readers miss deltas once."""
    library, is_set_back = tmp_path / "set_back.so", tmp_path / "is_set_back"
    source = pathlib.Path(__file__).with_name("set_back.cpp")
    cpp.compile(source, "-shared", "-fPIC", "-Wl,--as-needed", "-o", str(library))
    environment = {"LD_PRELOAD": str(library), "SET_BACK": str(is_set_back)}
    node, driver = begin(functools.partial(start, environment=environment), peer, drive)
    driver.sends(30)
    is_set_back.touch()
    said = node.line_with("the system's clock was set back by", "the network is joined anew")
    assert 599 < float(re.search(r"set back by ([\d.]+) s", said)[1]) < 601, said
    flows_again(peer, time.time_ns())
    is_there_once(peer)
    driver.sends(30)
    counts = stop(node, driver)
    assert sum("set back" in line for line in node.lines) == 1, node.lines
    one_map(peer, counts, gaps=1)


@pytest.fixture
def machine(own_network, request):
    """Where the driver is, at the other end of a wire."""
    if not shutil.which("ip"):
        leave_out(request, "no `ip` (iproute2) to lay a wire with")
    with other_machine("10.9.0.2") as machine:
        yield machine


def heard_anew(node, new_peer, words):
    """It says with these words that the network is joined anew, and then takes in scans of that time; returns who has seen it."""
    node.line_with("the addresses of this machine have changed", "the network is joined anew", *words)
    peer = new_peer()
    peer.record_node()
    peer.deltas.wait("the delta of a first scan", timeout=60)
    flows_again(peer, time.time_ns())
    return peer


def test_under_another_address_of_its_machine_the_node_is_heard_again_in_the_same_map(start, drive, machine, new_peer):
    """A lease that ends, another Wi-Fi. The node told others of the addresses that it began with; it notices, joins the network
    anew and says why. Who reads a latched topic then is given the map at once, however seldom it is sent."""
    machine.wire_has("10.9.0.1")
    node = start({"publish_rate": 0.01}).ready()
    driver = drive("--at-once", "--rate", 10, prefix=machine.inside)
    node.line_with("scans are made of", timeout=60)
    machine.wire_has("10.9.0.77", before="10.9.0.1")
    peer = heard_anew(node, new_peer, ["new: 10.9.0.77", "gone: 10.9.0.1"])
    peer.clusters.wait("the map of that moment", timeout=10)
    driver.finish()
    add_up(node.stop())
    assert sum("the network is joined anew" in line for line in node.lines) == 1, node.lines
    assert not any("begins with an empty map" in line for line in node.lines), node.lines


def test_of_two_interfaces_that_are_asked_for_the_one_that_is_back_is_enough(start, drive, machine, new_peer):
    """Wi-Fi that comes and goes, and a tether that was pulled before."""
    tether, radio = "10.9.0.77", "10.9.0.1"
    machine.wire_has(radio)
    machine.wire_has(tether)
    node = start({"network_interfaces": f"[{radio}, {tether}]"}).ready()
    driver = drive("--at-once", "--rate", 10, prefix=machine.inside)
    node.line_with("scans are made of", timeout=60)
    machine.wire_has("10.9.0.78", before=tether)
    machine.wire_has("10.9.0.79", before=radio)
    time.sleep(5)
    machine.wire_has(radio, before="10.9.0.79")
    heard_anew(node, new_peer, [f"new: {radio}", f"gone: {tether}"])
    driver.finish()
    add_up(node.stop())


def test_a_node_that_is_there_before_its_network_says_so_and_is_heard_once_that_is_up(start, drive, machine, new_peer):
    """As at the start of a robot."""
    node = start().ready()
    node.line_with("no network but loopback is up")
    machine.wire_has("10.9.0.1")
    driver = drive("--at-once", "--rate", 10, prefix=machine.inside)
    heard_anew(node, new_peer, ["new: 10.9.0.1"])
    driver.finish()
    add_up(node.stop())


#: Says each time that it sees the node's map come or go.
ONLOOKER = """
import sys
from peer import Peer, wait_until
node = Peer("onlooker").node
for there in (1, 0):
    wait_until("the node", lambda: node.count_publishers("/cfodi/clusters") == there)
    print(there, flush=True)
sys.stdin.read()
"""


def test_the_end_of_a_node_is_known_on_another_machine_at_once(start, machine):
    """Over there, too, nobody is to wait for what has gone."""
    machine.wire_has("10.9.0.1")
    node = start().ready()
    here = pathlib.Path(__file__).parent
    with subprocess.Popen([*machine.inside, sys.executable, "-c", ONLOOKER], cwd=here, stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as onlooker:
        try:
            assert onlooker.stdout.readline() == "1\n"
            node.stop()
            ended = time.monotonic()
            assert onlooker.stdout.readline() == "0\n"
            assert time.monotonic() < ended + 5, "it was waited for"
        finally:
            onlooker.kill()


@pytest.mark.alone
def test_a_driver_that_stalls_for_5_s_costs_no_scan(start, new_peer, drive):
    """While no scan comes there is nothing to lose: all that were sent are taken in, before and after, in one map; in one of three
    attempts, for the machine may be busy."""
    for _ in range(3):
        with contextlib.closing(new_peer()) as peer:
            node, driver = begin(start, peer, drive)
            driver.sends(30)
            stall(driver.process, STALL)
            flows_again(peer, time.time_ns())
            counts = stop(node, driver)
            one_map(peer, counts)
        if counts["lost"] == counts["replaced"] == 0:
            return
    pytest.fail(f"it cost scans: {counts}")


@contextlib.contextmanager
def other_reader():
    """A planner of another process, which has a map."""
    reader = subprocess.Popen([sys.executable, "-u", REPOSITORY / "examples" / "map_reader.py"],
                              stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    try:
        assert any(re.search("version [0-9]", line) for line in reader.stderr), "it has ended"
        yield reader
    finally:
        reader.kill()
        reader.communicate()


@pytest.mark.alone
def test_readers_that_join_and_are_killed_cost_the_others_nothing(start, peer, drive):
    """The middleware takes no message while a reader has not acknowledged the last so many, and who has just been found
    has acknowledged none. The node waits for it, and no delta is lost to those that were there before."""
    node, driver = begin(start, peer, drive, "--rate", HASTE)
    driver.sends(MOST_DELTAS + 100)
    driver.say("rate 20")  # at which fewer deltas than that wait for one that was killed until it is forgotten, after 20 s
    for _ in range(4):
        with other_reader():
            driver.sends(15)
    one_map(peer, stop(node, driver))


@pytest.mark.alone
def test_a_reader_that_stands_still_silences_the_node_for_nobody_else(start, peer, drive):
    """A reader that was stopped acknowledges nothing, and is believed to be there for 20 s. When as much waits for it as is
    kept, the node opens the topic anew, and the others go on; of the deltas they may miss some, once for each beginning."""
    node, driver = begin(start, peer, drive, "--rate", HASTE)
    driver.sends(MOST_DELTAS)
    with other_reader() as reader, stopped(reader):
        for _ in range(4):
            deltas, maps = len(peer.deltas), len(peer.clusters)
            driver.sends(3 * HASTE)
            wait_until("deltas: it has fallen silent", lambda: len(peer.deltas) > deltas + 2 * HASTE, 8)
            wait_until("maps", lambda: len(peer.clusters) > maps + 2, 8)
    node.line_with(f"a reader of ~/clusters_delta has not acknowledged the last {MOST_DELTAS}: the topic was opened anew")
    one_map(peer, stop(node, driver), gaps=2)


def most_resident(node, seconds):
    """The most memory (MB) that a process has in so many seconds: what is forgotten goes in rounds of some seconds."""
    statm, most, end = pathlib.Path(f"/proc/{node.process.pid}/statm"), 0, time.monotonic() + seconds
    while time.monotonic() < end:
        most = max(most, int(statm.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6)
        time.sleep(0.1)
    return most


@pytest.mark.alone
def test_where_nobody_reads_the_snapshots_memory_stays_level(start, drive):
    """The middleware keeps what a reader may still ask for; where there is none, the newest few and no more. Snapshots and
    markers of a room, 100 times a second, are 2.7 MB each second: 32 MB from one look to the next."""
    node = start({"publish_rate": 100.0}).ready()
    driver = drive("--scans=room", "--size", 320, 240)
    driver.sends(240)
    before, after = most_resident(node, 12), most_resident(node, 12)
    assert node.stop()["taken_in"] >= 500
    assert after < before + 15, f"{before:.1f} MB, then {after:.1f} MB"
