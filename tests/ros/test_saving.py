"""What has been learned survives: `~/save`, savings now and then and at the end, `--resume`."""

import functools
import pathlib
import signal
import subprocess
import time

import cpp
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from peer import qos, wait_until
from std_srvs.srv import Trigger
from test_diagnostics import OK, WARN, wait_for
from test_inputs import begin, take_in


def saving(path, **more):
    return {"snapshot_path": str(path), "snapshot_period": 3600.0} | more


def resumed(start, peer, parameters):
    """The node, gone on with its map, its first snapshot, and a camera that it hears."""
    node = start(parameters, options=["--resume"]).ready()
    peer.record_node()
    snapshot = peer.clusters.wait("a first snapshot")
    camera = peer.camera()
    camera.meet()
    return node, snapshot, camera


def test_after_a_crash_it_goes_on_with_the_saved_map_and_its_ids_under_a_new_session(tmp_path, start, peer, new_peer):
    path = tmp_path / "map.cfodi"
    node, camera = begin(start, peer, **saving(path))
    deltas = [take_in(camera, peer.deltas) for _ in range(4)]
    reply = peer.call(Trigger, "/cfodi/save", Trigger.Request())
    assert reply.success and "4 scans" in reply.message, reply.message
    before = peer.clusters.wait("a snapshot of all", lambda m: m.sequence == 4)
    node.process.send_signal(signal.SIGKILL)
    node.wait()
    other = new_peer("after")
    _, after, camera = resumed(start, other, saving(path))
    assert after.sequence == 4 and after.session_id != before.session_id
    assert [c.id for c in after.clusters] == [c.id for c in before.clusters] != []
    assert [c.voxel_count for c in after.clusters] == [c.voxel_count for c in before.clusters]
    delta = take_in(camera, other.deltas)
    assert (delta.base_sequence, delta.sequence) == (4, 5)
    assert {c.id for c in delta.clusters} <= {c.id for d in deltas for c in d.clusters}


def test_what_was_forgotten_by_a_reset_does_not_come_back_after_a_crash(tmp_path, start, peer, new_peer):
    """It is answered when that is on the disk."""
    path = tmp_path / "map.cfodi"
    node, camera = begin(start, peer, **saving(path))
    take_in(camera, peer.deltas)
    assert "1 scan saved" in peer.call(Trigger, "/cfodi/save", Trigger.Request()).message
    assert peer.call(Trigger, "/cfodi/reset", Trigger.Request()).success
    node.process.send_signal(signal.SIGKILL)
    node.wait()
    _, after, _ = resumed(start, new_peer("after"), saving(path))
    assert after.sequence == 0 and not after.clusters


def test_sigterm_while_it_saves_loses_no_scan(tmp_path, start, new_peer):
    """Saved every 0.1 s; whatever the moment, the map has all scans that were taken in, and nothing is left beside it."""
    path, scans = tmp_path / "map.cfodi", 0

    def file():
        """Another one each time that a map is saved."""
        return path.exists() and (path.stat().st_ino, path.stat().st_mtime_ns)

    for turn in range(3):
        before = file()
        peer = new_peer(f"turn_{turn}")
        node, snapshot, camera = resumed(start, peer, saving(path, snapshot_period=0.1))
        assert snapshot.sequence == scans
        for _ in range(5):
            take_in(camera, peer.deltas)
        wait_until("a first saving", lambda: file() != before)
        time.sleep(0.037 * turn)
        scans += node.stop(signal.SIGTERM)["taken_in"]
        assert sorted(p.name for p in tmp_path.iterdir()) == ["map.cfodi", "map.cfodi.lock"]
    assert scans >= 15


def on_a_disk(folder, options):
    """What to start the node with, so that it has a small file system there, in a mount namespace of its own."""
    return ["unshare", "-m", "sh", "-c", f'mount -t tmpfs -o {options} none "{folder}" && exec "$@"', "sh"]


def make_read_only(node, folder):
    """The lock is open for writing, so that the file system itself stays as it is; what is opened from now on is not."""
    script = 'mount --bind "$0" "$0" && mount -o remount,ro,bind "$0"'
    subprocess.run(["nsenter", "-t", str(node.process.pid), "-m", "sh", "-c", script, str(folder)], check=True)


def save_fails(peer, cause):
    reply = peer.call(Trigger, "/cfodi/save", Trigger.Request())
    assert not reply.success and "map.cfodi" in reply.message and cause in reply.message, reply.message


def end_fails(node, cause):
    node.process.send_signal(signal.SIGTERM)
    assert node.wait() == 1
    parts = ("not saved at the end", "map.cfodi", cause)
    assert [line for line in node.lines if all(part in line for part in parts)], node.lines[-5:]


def test_on_a_full_disk_a_call_is_told_so_the_node_goes_on_and_its_end_is_a_failure(tmp_path, start, peer):
    """A file system of one page."""
    cause = "No space left on device"
    node, camera = begin(start, peer, on_a_disk(tmp_path, "size=4k"), **saving(tmp_path / "map.cfodi"))
    take_in(camera, peer.deltas)
    save_fails(peer, cause)
    take_in(camera, peer.deltas)
    end_fails(node, cause)


def test_on_a_disk_that_becomes_read_only_the_map_before_stays_and_the_node_goes_on(tmp_path, start, peer):
    """As Linux makes it of a disk with errors. A call is told so, and so are the diagnostics; clusters go on, and the end is
    a failure."""
    cause = "Read-only file system"
    reports = peer.record("/diagnostics", DiagnosticArray, qos(100))
    node, camera = begin(start, peer, on_a_disk(tmp_path, "size=1m"), **saving(tmp_path / "map.cfodi"))
    take_in(camera, peer.deltas)
    assert peer.call(Trigger, "/cfodi/save", Trigger.Request()).success
    saved = pathlib.Path(f"/proc/{node.process.pid}/root{tmp_path}/map.cfodi")
    whole = saved.read_bytes()
    _, figures = wait_for(reports, "map", OK, "clusters: ")
    assert 0 <= float(figures["age of the saved map [s]"]) < 60
    make_read_only(node, tmp_path)
    for _ in range(3):
        take_in(camera, peer.deltas)
        save_fails(peer, cause)
    node.line_with("the map was not saved", "map.cfodi", cause)
    wait_for(reports, "map", WARN, "the map was not saved", "map.cfodi", cause)
    assert saved.read_bytes() == whole
    take_in(camera, peer.deltas)
    end_fails(node, cause)


@pytest.fixture
def hanging(tmp_path, start):
    """How a node is started whose disk brings nothing to an end while there is a file, and that file."""
    library, hangs = tmp_path / "hung_disk.so", tmp_path / "hangs"
    cpp.compile(pathlib.Path(__file__).with_name("hung_disk.cpp"), "-shared", "-fPIC", "-Wl,--as-needed", "-o", str(library))
    environment = {"LD_PRELOAD": str(library), "HANGS": str(hangs)}
    return functools.partial(start, environment=environment), hangs


def test_a_disk_that_hangs_at_the_end_is_told_of_and_one_more_signal_ends_the_node(tmp_path, hanging, peer):
    """What was saved before stays whole."""
    (start, hangs), path = hanging, tmp_path / "map.cfodi"
    node, camera = begin(start, peer, **saving(path))
    take_in(camera, peer.deltas)
    assert peer.call(Trigger, "/cfodi/save", Trigger.Request()).success
    whole = path.read_bytes()
    take_in(camera, peer.deltas)
    hangs.touch()
    node.process.send_signal(signal.SIGINT)
    node.line_with("the map is being written to", "map.cfodi", "one more signal ends the node without it")
    node.process.send_signal(signal.SIGINT)
    assert node.wait() == 1
    assert "the map was not saved at the end" in node.lines[-1], node.lines[-3:]
    assert path.read_bytes() == whole


def test_an_end_in_the_middle_of_a_saving_waits_for_it_and_saves_what_came_since(tmp_path, hanging, start, peer, new_peer):
    (hanging_start, hangs), path = hanging, tmp_path / "map.cfodi"
    node, camera = begin(hanging_start, peer, **saving(path, snapshot_period=0.1))
    take_in(camera, peer.deltas)
    wait_until("no saving", path.exists)
    hangs.touch()
    part = path.with_name("map.cfodi.part")
    take_in(camera, peer.deltas)
    wait_until("no saving under way", part.exists)
    whole = path.read_bytes()
    newest = take_in(camera, peer.deltas)
    node.process.send_signal(signal.SIGTERM)
    time.sleep(0.5)
    assert node.process.poll() is None, "it did not wait"
    assert path.read_bytes() == whole
    hangs.unlink()
    assert node.wait() == 0
    assert not part.exists()
    assert resumed(start, new_peer("after"), saving(path))[1].sequence == newest.sequence


def test_a_place_that_is_read_only_from_the_start_ends_it_at_once_with_the_reason(tmp_path, start):
    node = start(saving(tmp_path / "map.cfodi"), prefix=on_a_disk(tmp_path, "ro"))
    assert node.wait() == 1
    assert [line for line in node.lines if "map.cfodi" in line and "Read-only file system" in line], node.lines


def of_version(version):
    return b"cfodimap" + version.to_bytes(4, "little") + bytes(96)


@pytest.mark.parametrize("written, why", [(b"cfodimap", "holds no whole map"), (of_version(4), "is of version 4;"),
                                          (of_version(99), "is of version 99;")], ids=["damaged", "older", "newer"])
def test_a_map_that_is_damaged_or_of_another_version_is_kept_aside_and_said_and_the_node_begins_empty(
        written, why, tmp_path, start, peer):
    path = tmp_path / "map.cfodi"
    path.write_bytes(written)
    node, snapshot, camera = resumed(start, peer, saving(path))
    assert snapshot.sequence == 0 and not snapshot.clusters
    node.line_with("not resumed", why, "map.cfodi.refused-1")
    assert (tmp_path / "map.cfodi.refused-1").read_bytes() == written
    take_in(camera, peer.deltas)
    node.stop()
    assert path.exists()


def test_a_map_of_another_voxel_size_ends_it_with_status_2(tmp_path, start, peer):
    path = tmp_path / "map.cfodi"
    node, camera = begin(start, peer, **saving(path))
    take_in(camera, peer.deltas)
    node.stop()
    whole = path.read_bytes()
    node = start(saving(path, voxel_size=0.05), options=["--resume"])
    assert node.wait() == 2
    assert [line for line in node.lines if "voxel_size 0.08" in line and "0.05" in line], node.lines
    assert path.read_bytes() == whole


def test_without_a_file_it_says_what_is_missing(start, peer):
    assert start(options=["--resume"]).wait() == 2
    start().ready()
    reply = peer.call(Trigger, "/cfodi/save", Trigger.Request())
    assert not reply.success and "snapshot_path" in reply.message
