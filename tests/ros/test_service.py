"""The systemd unit: that systemd takes it, and that the program takes the command line it holds."""

import re
import shlex
import shutil
import subprocess

import pytest
from cfodi_node import program
from launching import SCRIPTS
from left_out import leave_out
from test_introspection import parameters

INSTALLED, ENVIRONMENT = "/usr/local/bin/cfodi", "/etc/cfodi/cfodi.env"
UNIT = (SCRIPTS / "cfodi.service").read_text()


def setting(name):
    """The only value of a setting."""
    [value] = re.findall(rf"^{name}=(.*)$", UNIT, re.MULTILINE)
    return value


def environment():
    """The variables of cfodi.env, as systemd reads it."""
    lines = (line for line in (SCRIPTS / "cfodi.env").read_text().splitlines() if line and not line.startswith("#"))
    return {name: "".join(shlex.split(value)) for name, value in (line.split("=", 1) for line in lines)}


def command(state):
    """What ExecStart runs, after the program: a variable without braces is split at spaces, %S is the folder of states."""
    words = setting("ExecStart").replace("%S", str(state)).split()
    assert words.pop(0) == INSTALLED
    variables = environment()
    return [part for word in words for part in (variables[word[1:]].split() if word.startswith("$") else [word])]


def test_systemd_takes_the_unit(tmp_path, request):
    if not shutil.which("systemd-analyze"):
        leave_out(request, "no systemd-analyze")
    (tmp_path / "cfodi.env").write_text((SCRIPTS / "cfodi.env").read_text())
    unit = tmp_path / "cfodi.service"
    unit.write_text(UNIT.replace(INSTALLED, str(program())).replace(ENVIRONMENT, str(tmp_path / "cfodi.env")))
    verified = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, timeout=60)
    # Of a misspelt name it says a line, and ends with status 0. Units of the machine's own are not ours.
    said = [line for line in verified.stderr.splitlines() if "cfodi" in line]
    assert verified.returncode == 0 and not said, verified.stderr


def test_its_command_starts_the_node_which_goes_on_with_its_map(start, peer, tmp_path):
    assert setting("EnvironmentFile") == ENVIRONMENT and setting("StateDirectory") == "cfodi"
    (tmp_path / "cfodi").mkdir()  # as StateDirectory does
    verb, resume, ros_args, *arguments = command(tmp_path)
    assert (verb, resume, ros_args) == ("run", "--resume", "--ros-args")
    for said in ("nothing to resume", "resumed: 0 voxels"):
        node = start(fixed_frame=None, points=None, options=[resume], arguments=arguments,
                     environment={"ROS_DOMAIN_ID": environment()["ROS_DOMAIN_ID"]}).ready()
        node.line_with(said)
        path = {"snapshot_path": str(tmp_path / "cfodi" / "map.cfodi"), "fixed_frame": "map"}
        assert parameters(peer, path) == path
        node.stop()


def test_what_no_new_start_would_mend_has_the_status_that_the_unit_names(start, tmp_path):
    arguments = [*command(tmp_path)[3:], "-p", "voxel_size:=0"]
    node = start(fixed_frame=None, points=None, arguments=arguments)
    assert node.wait() == int(setting("RestartPreventExitStatus")), node.lines
