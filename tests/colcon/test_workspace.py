"""The repository in a colcon workspace: what `colcon build` installs, and that ROS 2's tools would find it there."""

import os
import pathlib
import shutil
import subprocess
import sys
import tomllib
from xml.etree import ElementTree

import pytest
from ament_index_python import get_package_prefix, get_package_share_directory
from cfodi_node import REPOSITORY, Cfodi, program
from launching import launched

COLCON = pathlib.Path(os.environ["CFODI_COLCON"]) / "bin"


def target_of_program():
    """The cargo target that the program under test was built in."""
    target = pathlib.Path(program()).resolve().parents[1]
    assert (target / ".rustc_info.json").is_file(), f"{target} is no target folder of cargo"
    return target


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A workspace with a copy of the sources, built as docs/install.md says.

    The build folder is the target of the program under test, so that cargo finds the crates there, and is not searched for
    packages; our own code, which lies elsewhere, is compiled as quickly as can be."""
    workspace = tmp_path_factory.mktemp("workspace")
    shutil.copytree(REPOSITORY, workspace / "src" / "cfodi", symlinks=True,
                    ignore=shutil.ignore_patterns("target", ".git", "cfodi-demo"))
    (workspace / "src" / "cfodi_msgs").symlink_to("cfodi/msg")
    (workspace / "build").mkdir()
    (workspace / "build" / "cfodi").symlink_to(target_of_program())
    command = [COLCON / "colcon", "build", "--base-paths", "src",
               "--cmake-args", "-G", "Ninja", "-DBUILD_TESTING=OFF", f"-DPython3_EXECUTABLE={sys.executable}",
               "--cargo-args", "--bin", "cfodi", "--config", "profile.dev.package.cfodi.opt-level=0"]
    built = subprocess.run(command, cwd=workspace, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                           env=os.environ | {"PATH": f"{os.environ['PATH']}:{COLCON}", "CARGO_NET_OFFLINE": "true"})
    said = [line for line in built.stdout.splitlines() if not line.startswith("{")]  # less cargo's metadata
    assert built.returncode == 0, "\n".join(said[-60:])
    return workspace


@pytest.fixture
def sourced(workspace, monkeypatch):
    """The variables after `. install/setup.sh`."""
    shown = subprocess.run(["sh", "-c", ". install/setup.sh && env -0"], cwd=workspace, stdout=subprocess.PIPE, check=True)
    for variable in shown.stdout.decode().split("\0")[:-1]:
        monkeypatch.setenv(*variable.split("=", 1))


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_the_node_lies_where_ros2_run_looks(workspace, sourced):
    prefix = pathlib.Path(get_package_prefix("cfodi"))
    assert prefix == workspace / "install" / "cfodi"
    assert files(prefix / "lib" / "cfodi") == ["cfodi"]
    said = subprocess.run([prefix / "lib" / "cfodi" / "cfodi", "--version"], stdout=subprocess.PIPE, text=True, check=True)
    assert said.stdout.startswith("cfodi ")


@pytest.mark.parametrize("share, source", [("launch", "launch_scripts"), ("config", "config")])
def test_launch_files_and_parameters_lie_in_its_share(share, source, sourced):
    installed = pathlib.Path(get_package_share_directory("cfodi")) / share
    assert files(installed) == files(REPOSITORY / source)


def test_ros2_launch_finds_each_file_and_its_node_comes_up(sourced, tmp_path):
    folder = pathlib.Path(get_package_share_directory("cfodi"))
    for name in ("node.launch.py", "cloud.launch.py", "kinect_v1.launch.py", "replay.launch.py"):
        [file] = folder.rglob(name)  # as ros2 launch looks for it
        context = launched(file, tmp_path, **({"bag": "b"} if name == "replay.launch.py" else {}))
        [process] = (process for process in context.processes if process.package == "cfodi")
        node = Cfodi(arguments=process.command[2:],
                     binary=pathlib.Path(get_package_prefix(process.package)) / "lib" / process.package / process.executable)
        try:
            node.ready().stop()
        finally:
            node.end()


def test_the_messages_are_generated(workspace, sourced):
    share = pathlib.Path(get_package_share_directory("cfodi_msgs"))
    assert share.is_relative_to(workspace)
    assert {path.name for path in (share / "msg").glob("*.msg")} == {path.name for path in (REPOSITORY / "msg").glob("*.msg")}
    found = "from cfodi_msgs.msg import SurfaceClusterArray as a; import cfodi_msgs; print(a(sequence=7), cfodi_msgs.__file__)"
    said = subprocess.run([sys.executable, "-c", found], stdout=subprocess.PIPE, text=True, check=True).stdout
    assert "sequence=7" in said and str(workspace) in said


def test_the_build_leaves_the_sources_as_they_were(workspace):
    for name in (".cargo/config.toml", "Cargo.lock", ".gitignore"):
        assert (workspace / "src" / "cfodi" / name).read_bytes() == (REPOSITORY / name).read_bytes(), name


def test_both_packages_have_the_version_of_the_crate():
    crate = tomllib.loads((REPOSITORY / "Cargo.toml").read_text())["package"]["version"]
    for file in (REPOSITORY / "package.xml", REPOSITORY / "msg" / "package.xml"):
        assert ElementTree.parse(file).findtext("version") == crate, file
