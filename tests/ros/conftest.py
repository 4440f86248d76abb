"""Every test in a network of its own, with real ROS 2 on the other side."""

import os

# Before rclpy: shared memory would reach across namespaces, to the tests of another run.
os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY", "RMW_IMPLEMENTATION"):
    os.environ.pop(name, None)

import pytest
from xdist.scheduler import LoadScopeScheduling

import network
from left_out import leave_out

# The tests of these files share what their module has: a network and Zenoh's threads in it, a bag.
SHARED = ("test_zenoh.py", "test_disks.py")


class Scheduling(LoadScopeScheduling):
    """Each test on whichever worker is free, but those of a file of SHARED on one, one after the other. The mark `xdist_group`
    would say it where the tests are, but pytest-xdist 3.8 does not heed it under pytest 9.2."""

    def _split_scope(self, nodeid):
        file, _, _ = nodeid.partition("::")
        return file if file.endswith(SHARED) else nodeid


def pytest_xdist_make_scheduler(config, log):
    return Scheduling(config, log) if config.getvalue("dist") == "loadscope" else None


def pytest_configure(config):
    if hasattr(config, "workerinput"):  # pytest-xdist: workers do not share what they begin in either
        network.own_network()


@pytest.fixture(autouse=True)
def own_network():
    network.own_network()


@pytest.fixture
def recordings(request):
    """The folder of the recordings. Where it is not there the test is left out."""
    folder = network.recordings()
    if folder is None:
        leave_out(request, "no recordings (set CFODI_DATA)")
    return folder


@pytest.fixture
def large_buffers():
    """Clouds of megabytes come through only with a large socket buffer, which the kernel must allow."""
    if (granted := network.granted_buffer()) < network.LARGE_BUFFER:
        pytest.fail(f"the kernel grants {granted} bytes to a socket; large clouds need {network.LARGE_BUFFER}: "
                    f"sysctl -w net.core.rmem_max={network.LARGE_BUFFER}")


@pytest.fixture
def new_peer(own_network):
    from peer import Peer
    peers = []

    def start(name="peer", **more):
        peers.append(Peer(name, **more))
        return peers[-1]

    yield start
    for peer in peers:
        peer.close()


@pytest.fixture
def peer(new_peer):
    return new_peer()


@pytest.fixture
def start(own_network):
    """Starts the program under test; at the end of the test nothing of it is left."""
    from cfodi_node import Cfodi
    started = []

    def start(parameters=None, remaps=None, fixed_frame="map", points="/camera/depth/points", **more):
        parameters = ({"fixed_frame": fixed_frame} if fixed_frame else {}) | (parameters or {})
        started.append(Cfodi(parameters, ({"points": points} if points else {}) | (remaps or {}), **more))
        return started[-1]

    yield start
    for node in started:
        node.end()
        print("\n".join(node.lines))
