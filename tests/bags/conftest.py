"""Bags that are made once for all tests, by the tools that users have."""

import pathlib
import tempfile
import types

import bags
import pytest
import replay
from left_out import leave_out


@pytest.fixture(scope="session", autouse=True)
def binary():
    path = pathlib.Path(replay.BINARY)
    assert path.is_file(), f"there is no {path}: build it (cargo build --release) or set CFODI_BIN"
    return path


@pytest.fixture(scope="session")
def space():
    """A folder for bags; gone at the end."""
    with tempfile.TemporaryDirectory(prefix="cfodi-bags-") as folder:
        yield pathlib.Path(folder)


@pytest.fixture
def recordings(request):
    """The folder of the recordings. Where it, or the tool that makes bags of it, is not there, the test is left out."""
    if (bags.DATA / "tum_fr3_cabinet58" / "poses.csv").is_file() and (bags.TOOLS / "rgbd_to_bag.py").is_file():
        return bags.DATA
    leave_out(request, "no recordings or no tool for bags (set CFODI_DATA and CFODI_TOOLS)")


class Made:
    """Bags by name, each made when it is first asked for."""

    def __init__(self, space):
        self.space, self.done = space, {}

    def bag(self, name, sequence, *options):
        """The ROS 1 bag of a recording."""
        key = name, *options
        if key not in self.done:
            self.done[key] = bags.record(self.space / f"{name}.bag", sequence, *options)
        return self.done[key]

    def folder(self, name, sequence, *options, compression="plain"):
        """That bag, converted."""
        key = name, compression
        if key not in self.done:
            source = self.bag(name, sequence, *options)
            self.done[key] = bags.convert(source, self.space / f"{name}-{compression}", *bags.COMPRESSIONS[compression])
        return self.done[key]

    def replay(self, name, bag, **more):
        """A run over a bag that several tests look at."""
        key = name, "replayed"
        if key not in self.done:
            self.done[key] = replay.Replay(bag, self.space / f"{name}-replayed", **more)
        return self.done[key]


@pytest.fixture(scope="session")
def _made(space):
    return Made(space)


@pytest.fixture
def made(recordings, _made):
    return _made


RECORDINGS = {
    # name: (folder, options, options with full-size clouds, scans)
    "cabinet": ("tum_fr3_cabinet58", ("--decimate", "2"), (), 58),
    "desk": ("tum_rpy179", ("--step", "3", "--decimate", "2"), ("--step", "3", "--layout", "openni32"), 60),
}


@pytest.fixture
def recording(made):
    """`recording(name)`: `.scans`; `.folder(compression)`; `.replay()`, the one run of it that all look at."""
    def of(name):
        sequence, small, full, scans = RECORDINGS[name]
        options = (*(full if bags.FULL else small), "--no-depth")
        if (stream := bags.DATA / sequence / "tf_100hz.csv").is_file():
            options += ("--tf-csv", stream)

        def folder(compression="plain"):
            return made.folder(name, sequence, *options, compression=compression)

        return types.SimpleNamespace(
            name=name, scans=scans, folder=folder, bag=lambda: made.bag(name, sequence, *options),
            replay=lambda: made.replay(name, folder(), parameters={"mode": "paper"}))
    return of
