"""The same bag gives the same bytes: on one core and on all, optimised as a release is and less."""

import os
import pathlib
import subprocess

import pytest
import replay

DEBUG = pathlib.Path(os.environ.get("CFODI_DEBUG_BIN")
                     or pathlib.Path(os.environ.get("CARGO_TARGET_DIR") or replay.REPOSITORY / "target") / "debug" / "cfodi")
OUTPUTS = ("voxels", "clusters", "ply", "out")


@pytest.fixture(scope="module")
def debug():
    """tests/run.sh has built it for the Rust tests and kept it; with debug assertions and overflow checks."""
    if not DEBUG.is_file():
        subprocess.run(["cargo", "build", "--bin", "cfodi"], cwd=replay.REPOSITORY, check=True, timeout=1800)
    return DEBUG


def one_core():
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def outputs(binary, bag, folder, parameters, alone=False):
    folder.mkdir()
    command = [str(binary), "replay", str(bag)]
    for name in OUTPUTS:
        command += [f"--{name}", str(folder / replay.OUTPUTS[name])]
    command += ["--ros-args"]
    for name, value in parameters.items():
        command += ["-p", f"{name}:={value}"]
    subprocess.run(command, check=True, capture_output=True, timeout=300, preexec_fn=one_core if alone else None)
    return {name: (folder / replay.OUTPUTS[name]).read_bytes() for name in OUTPUTS}


def simulate(binary, bag):
    subprocess.run([str(binary), "simulate", "--out", str(bag), "--scene", "moving", "--seconds", "1", "--seed", "5"],
                   check=True, capture_output=True, timeout=300)
    return bag


@pytest.mark.parametrize("parameters", [{"mode": "consistent"}, {"mode": "consistent", "max_voxels": 2000, "voxel_size": 0.05},
                                        {"mode": "paper"}], ids=["consistent", "bounded", "paper"])
def test_builds_and_cores_do_not_show_in_the_bytes(parameters, debug, tmp_path):
    bag = simulate(replay.BINARY, tmp_path / "drive.mcap")
    release = outputs(replay.BINARY, bag, tmp_path / "release", parameters)
    assert len(release["voxels"]) > 10_000, "a map, not an empty one"
    for name, other in (("one core", outputs(replay.BINARY, bag, tmp_path / "one", parameters, alone=True)),
                        ("debug", outputs(debug, bag, tmp_path / "debug", parameters))):
        assert [output for output in OUTPUTS if other[output] != release[output]] == [], name


def test_a_simulated_drive_has_the_same_bytes_in_a_debug_build(debug, tmp_path):
    assert simulate(replay.BINARY, tmp_path / "a.mcap").read_bytes() == simulate(debug, tmp_path / "b.mcap").read_bytes()
