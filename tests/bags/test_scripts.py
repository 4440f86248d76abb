"""What the scripts that run the tests say where a machine lacks something: at once, and what to do."""

import os
import shutil
import subprocess

import pytest
from bags import REPOSITORY

TESTS = REPOSITORY / "tests"


def run(script, *arguments, **variables):
    """Its exit status and what it says as an error."""
    done = subprocess.run([shutil.which("bash"), TESTS / script, *arguments], env=os.environ | variables,
                          stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)
    print(done.stdout, done.stderr)
    return done.returncode, done.stderr


def test_all_that_a_machine_lacks_is_named_before_anything_is_built(tmp_path):
    for tool in ("bash", "dirname", "realpath", "mktemp", "cat", "sort", "wc", "rm"):
        (tmp_path / tool).symlink_to(shutil.which(tool))
    status, said = run("run.sh", PATH=str(tmp_path), OPENSSL_NO_VENDOR="", CARGO_TARGET_DIR=str(tmp_path / "target"))
    assert status == 1 and "FAILED" not in said
    lacks = [line.split(" ")[1] for line in said.splitlines()[1:]]
    assert lacks == ["cargo", "cc", "c++", "make", "flock", "unshare", "nsenter", "kill", "python3.11", "OpenSSL"]
    assert said.count("apt-get install") >= len(lacks) - 1


@pytest.mark.parametrize("script", ["ros/python.sh", "bags/python.sh"])
def test_where_namespaces_are_refused_it_says_what_allows_them(script, tmp_path):
    refuses = tmp_path / "unshare"
    refuses.write_text("#!/bin/sh\necho 'unshare failed: Operation not permitted' >&2\nexit 1\n")
    refuses.chmod(0o755)
    status, said = run(script, "-c", "pass", PATH=f"{tmp_path}:{os.environ['PATH']}")
    assert status == 1 and "unshare failed: Operation not permitted" in said
    for setting in ("kernel.unprivileged_userns_clone=1", "kernel.apparmor_restrict_unprivileged_userns=0"):
        assert setting in said


def test_without_the_headers_of_python_no_ros_is_built(tmp_path):
    (tmp_path / "sitecustomize.py").write_text("import sysconfig\nsysconfig.get_path = lambda *_, **__: '/no/include'\n")
    cache = tmp_path / "cache"
    status, said = run("ros/env.sh", PYTHONPATH=str(tmp_path), CFODI_CACHE=str(cache))
    assert status == 1 and "/no/include/Python.h" in said and "python3.11-dev" in said
    assert not cache.exists()


@pytest.mark.parametrize("noted, said", [
    ("", "0 tests left out"),
    ("a.rs::one\tno recordings: set CFODI_DATA\n", "1 test left out: 1 no recordings: set CFODI_DATA"),
    # Of the two of one name each counts, and none twice.
    ("a.py::one\tno: browser\nb.py::one\tno: browser\nb.py::one\tno: browser\na.rs::two\tno recordings\n",
     "3 tests left out: 2 no: browser; 1 no recordings")])
def test_what_is_left_out_is_counted_once_and_by_its_whole_reason(noted, said, tmp_path):
    (tmp_path / "noted").write_text(noted)
    done = subprocess.run(["bash", TESTS / "left_out.sh", tmp_path / "noted"], capture_output=True, text=True, check=True)
    assert done.stdout == f"{said}\n"
