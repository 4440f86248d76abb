"""Disks that fill and disks that are read-only: the program says which file and why, and leaves nothing half-written."""

import os
import signal
import subprocess

import pytest
from cfodi_node import REPOSITORY
from std_srvs.srv import Trigger
from test_inputs import begin, take_in

BINARY = str(os.environ.get("CFODI_BIN") or REPOSITORY / "target" / "release" / "cfodi")
FULL, READ_ONLY, TOO_LARGE = "No space left on device", "Read-only file system", "File too large"
# Files of a kibibyte at most.
SMALL_FILES = ["sh", "-c", 'ulimit -f 2 && exec "$@"', "sh"]
SIZE = "size=512k"

# Mounts a small disk on $1 in a mount namespace of its own, runs the rest, and lists what is left there.
ON_A_DISK = """
set -e
folder=$1 options=$2; shift 2
mount -t tmpfs -o "$options" cfodi "$folder"
[ "$options" = "${options#*,ro}" ] || mount -o remount,ro "$folder"
status=0
"$@" || status=$?
cd "$folder"
find . -type f -size +0 -o -type f -name '.*' >&3
exit $status
"""


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    """A second of a drive, recorded."""
    bag = tmp_path_factory.mktemp("bag") / "room.mcap"
    subprocess.run([BINARY, "simulate", "--scene=room", "--seconds=1", "--out", bag], check=True, timeout=120)
    return bag


def on_a_disk(tmp_path, options, *command):
    """Runs the program with `{}` in its arguments replaced by a folder on such a disk: status, log, files left."""
    folder, listed = tmp_path / "disk", tmp_path / "listed"
    folder.mkdir()
    command = [BINARY] + [argument.format(folder) for argument in map(str, command)]
    script = f"exec 3>{listed}\n{ON_A_DISK}"
    done = subprocess.run(["unshare", "-m", "bash", "-c", script, "bash", str(folder), options, *command],
                          capture_output=True, text=True, timeout=180)
    print(done.stdout, done.stderr)
    return done.returncode, done.stderr, listed.read_text().split()


def says(log, cause, name):
    """The last line is an error that names the file and the cause."""
    last = log.strip().splitlines()[-1]
    return last.startswith("cfodi: cannot ") and name in last and last.endswith(f"{cause} (os error {ERRORS[cause]})")


ERRORS = {FULL: 28, READ_ONLY: 30, TOO_LARGE: 27}
DISKS = pytest.mark.parametrize("cause, options", [(FULL, SIZE), (READ_ONLY, SIZE + ",ro")], ids=["full", "read-only"])


@DISKS
def test_a_simulation_that_cannot_write_its_bag_says_so_and_leaves_none(cause, options, tmp_path):
    """Exit status 1, a last line with the file and the cause, and neither a bag nor a part of one."""
    status, log, left = on_a_disk(tmp_path, options, "simulate", "--scene=room", "--seconds=1", "--out", "{}/a.mcap")
    assert status == 1 and says(log, cause, "a.mcap") and not left


@DISKS
@pytest.mark.parametrize("output, name", [
    ("--out", "result.mcap"), ("--voxels", "v.csv"), ("--clusters", "c.json"), ("--ply", "p.ply"), ("--report", "report"),
])
def test_a_replay_that_cannot_write_an_output_says_so_and_leaves_none(output, name, cause, options, bag, tmp_path):
    """Exit status 1, a last line with the file and the cause, and nothing under the final name."""
    if cause == FULL:
        options = "size=16k"
    status, log, left = on_a_disk(tmp_path, options, "replay", bag, output, f"{{}}/{name}")
    assert status == 1 and says(log, cause, name) and not left


@DISKS
def test_a_demo_that_cannot_write_says_so_and_leaves_no_half_file(cause, options, tmp_path):
    """On a read-only disk it does not begin to drive. On a full one the robot drives on, its results go out, and at the
    end it says which file could not be written; what is there is whole."""
    status, log, left = on_a_disk(tmp_path, options, "demo", "--seconds=2", "--out", "{}/demo")
    assert status == 1 and says(log, cause, "demo")
    assert ("counts {" in log) == (cause == FULL)
    assert not [name for name in left if name.endswith(".part") or "result" in name], left


def test_a_demo_whose_bag_cannot_be_written_leaves_its_pictures(tmp_path):
    """The disk behind the result bag is full, and the one behind the pictures is not."""
    (tmp_path / "result.mcap").symlink_to("/dev/full")
    done = subprocess.run([BINARY, "demo", "--seconds=2", "--out", tmp_path], capture_output=True, text=True, timeout=180)
    assert done.returncode == 1 and says(done.stderr, FULL, "result.mcap"), done.stderr
    assert all((tmp_path / name).stat().st_size > 100 for name in ("map.ply", "map.png"))


def test_a_demo_names_each_file_that_cannot_be_written(tmp_path):
    names = ["result.mcap", "map.ply", "map.png"]
    for name in names:
        (tmp_path / name).symlink_to("/dev/full")
    done = subprocess.run([BINARY, "demo", "--seconds=2", "--out", tmp_path], capture_output=True, text=True, timeout=180)
    # Each on a line of its own.
    lines = {name: [line for line in done.stderr.splitlines() if f"/{name}: " in line] for name in names}
    assert done.returncode == 1 and all(len(lines[name]) == 1 and says(lines[name][0], FULL, name) for name in names), done.stderr


def test_a_node_whose_map_may_not_be_as_large_goes_on_says_so_and_its_end_is_a_failure(tmp_path, start, peer):
    """The limit of `ulimit -f` or `LimitFSIZE=`, whose signal would end it without a word."""
    parameters = {"snapshot_path": str(tmp_path / "map.cfodi"), "snapshot_period": 0.5}
    node, camera = begin(start, peer, SMALL_FILES, **parameters)
    take_in(camera, peer.deltas)
    node.line_with("the map was not saved", "map.cfodi", TOO_LARGE)
    take_in(camera, peer.deltas)
    reply = peer.call(Trigger, "/cfodi/save", Trigger.Request())
    assert not reply.success and TOO_LARGE in reply.message, reply.message
    node.process.send_signal(signal.SIGTERM)
    assert node.wait() == 1 and node.said("not saved at the end", "map.cfodi", TOO_LARGE), node.lines[-5:]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.cfodi", "map.cfodi.lock"]


def test_a_demo_whose_files_may_not_be_as_large_says_so(tmp_path):
    done = subprocess.run([*SMALL_FILES, BINARY, "demo", "--seconds=2", "--out", tmp_path], capture_output=True, text=True,
                          timeout=180)
    assert done.returncode == 1 and says(done.stderr, TOO_LARGE, str(tmp_path)), done.stderr


def test_a_single_file_that_is_mounted_gets_the_whole_output(bag, tmp_path):
    """As in a container: its name cannot be taken by another file."""
    behind, voxels = tmp_path / "behind.csv", tmp_path / "voxels.csv"
    behind.write_text("before" * 1_000_000)
    voxels.write_text("")
    script = 'set -e; mount --bind "$1" "$2"; shift 2; exec "$@"'
    done = subprocess.run(["unshare", "-m", "bash", "-c", script, "bash", behind, voxels, BINARY, "replay", bag, "--voxels", voxels],
                          capture_output=True, text=True, timeout=180)
    assert done.returncode == 0, done.stderr
    assert behind.read_text().startswith("ix,iy,iz,") and "before" not in behind.read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["behind.csv", "voxels.csv"]
