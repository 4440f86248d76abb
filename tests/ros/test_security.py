"""DDS Security as SROS 2 sets it up: who has keys is heard and hears, who has none learns nothing, bad keys end it at once.

Two builds: CFODI_BIN without the cargo feature `security`, and the folder CFODI_SECURED with it (tests/run.sh makes both).
"""

import os
import pathlib
import re
import subprocess
import threading
import time

import pytest
from capture import Capture, sockets
from cfodi_msgs.msg import SurfaceClusterArray
from cfodi_node import REPOSITORY
from keystore import DAY, NOW, Authority, Keystore, certified, governance, pem, permissions
from peer import qos, wait_until

SECURED = pathlib.Path(os.environ.get("CFODI_SECURED") or REPOSITORY / "target" / "secured")
ENCLAVE = ["--enclave", "/robot/cfodi"]
# What who looks on could learn of the node: a type, a topic and the frame of its map.
PLAIN = (b"SurfaceClusterArray_", b"rt/cfodi/clusters", b"map\0")
# That a participant is gone, by the hash of its key: PID_KEY_HASH and PID_STATUS_INFO.
FAREWELL = re.compile(rb"\x70\0\x10\0.{12}\0\0\x01\xc1\x71\0\x04\0\0\0\0\x03", re.DOTALL)


@pytest.fixture
def keys(tmp_path):
    """A keystore with enclaves for the node, a driver and a planner."""
    keystore = Keystore(tmp_path / "keystore")
    for enclave in ("/robot/cfodi", "/driver", "/planner"):
        keystore.enclave(enclave)
    return keystore


@pytest.fixture
def run():
    """Starts an example of the secured build and collects the lines it prints."""
    processes = []

    def run(name, *arguments, environment=None):
        variables = {k: v for k, v in os.environ.items() if k not in ("LD_LIBRARY_PATH", "PYTHONPATH")}
        process = subprocess.Popen([SECURED / name, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True, env=variables | (environment or {}))
        process.lines = []
        reader = threading.Thread(target=lambda: process.lines.extend(map(str.rstrip, process.stdout)), daemon=True)
        reader.start()
        processes.append((process, reader))
        return process

    yield run
    for process, reader in processes:
        process.kill()
        process.wait()
        reader.join(5)
        print(process.args[0], *process.lines[-20:], sep="\n")


def clusters_read(reader):
    """How many clusters the newest map has that the example `clusters` has read; None before the first map."""
    maps = [line for line in list(reader.lines) if line.startswith("version ")]
    return int(maps[-1].split()[-2]) if maps else None


def comes(condition, timeout):
    """Whether `condition()` is true in time."""
    end = time.monotonic() + timeout
    while not (value := condition()) and time.monotonic() < end:
        time.sleep(0.05)
    return bool(value)


def refused(node, capture, *says):
    """It ends with status 2, says why in one line, and nothing has crossed the network."""
    assert node.wait(60) == 2, "\n".join(node.lines)
    assert [line for line in node.lines if all(part in line for part in says)], "\n".join(node.lines)
    assert not any("ready:" in line for line in node.lines)
    assert capture.stop() == []


def test_without_security_the_capture_sees_packets_and_reads_them(start, peer):
    capture = Capture()
    node = start().ready()
    peer.record("/cfodi/clusters", SurfaceClusterArray, qos(1, latched=True))
    for word in (b"RTPS", *PLAIN):
        wait_until(f"packets with {word}", lambda: any(word in packet for packet in list(capture.packets)), 60)
    node.stop()
    assert any(FAREWELL.search(packet) for packet in capture.stop())


def test_enforce_without_the_feature_ends_it_before_a_packet_is_sent(start, keys):
    capture = Capture()
    node = start(arguments=ENCLAVE, environment=keys.variables())
    refused(node, capture, "ROS_SECURITY_ENABLE", "not built in", "--features security")


NOWHERE = {
    "no keystore": ({"ROS_SECURITY_KEYSTORE": ""}, "ROS_SECURITY_KEYSTORE is not set"),
    "a keystore that is not there": ({"ROS_SECURITY_KEYSTORE": "/no/such"}, "/no/such/enclaves/robot/cfodi"),
    "an enclave that is not there": ({"ROS_SECURITY_ENCLAVE_OVERRIDE": "/other"}, "enclaves/other of enclave /other"),
    "a misspelt strategy": ({"ROS_SECURITY_STRATEGY": "enforce"}, 'ROS_SECURITY_STRATEGY is "enforce"'),
    "a misspelt switch": ({"ROS_SECURITY_ENABLE": "True"}, 'ROS_SECURITY_ENABLE is "True"'),
    "a domain without rules": ({"ROS_DOMAIN_ID": "7"}, "/robot/cfodi"),
}


@pytest.mark.parametrize("variables, says", NOWHERE.values(), ids=NOWHERE)
def test_enforce_without_keys_ends_it_before_a_packet_is_sent(variables, says, start, keys):
    capture = Capture()
    node = start(arguments=ENCLAVE, environment=keys.variables() | variables, binary=SECURED / "cfodi")
    refused(node, capture, says)


def instead(folder, name, content):
    """Puts another file in the place of one that may be a link to what all enclaves share."""
    (folder / name).unlink()
    (folder / name).write_bytes(content)


def identity(folder, by, until=NOW + DAY):
    key, certificate = certified("/robot/cfodi", by, until)
    instead(folder, "key.pem", pem(key))
    instead(folder, "cert.pem", pem(certificate))


def altered(folder, name, old, new):
    content = (folder / name).read_bytes()
    assert old in content
    instead(folder, name, content.replace(old, new))


BAD = {
    "a file is missing": (lambda folder, by: (folder / "key.pem").unlink(), "lacks key.pem"),
    "a link leads nowhere": (
        lambda folder, by: ((folder / "governance.p7s").unlink(), (folder / "governance.p7s").symlink_to("no")),
        "lacks governance.p7s"),
    "garbage for an identity": (lambda folder, by: instead(folder, "cert.pem", b"\xff\x00 no"), "cert.pem is no certificate"),
    "garbage for a key": (lambda folder, by: instead(folder, "key.pem", b""), "key.pem is no private key"),
    "garbage for an authority": (
        lambda folder, by: instead(folder, "identity_ca.cert.pem", b"no"), "identity_ca.cert.pem is no certificate"),
    "an identity of another authority": (lambda folder, by: identity(folder, Authority()), "identity CA"),
    "another's key": (lambda folder, by: instead(folder, "key.pem", pem(certified("x")[0])), "not the key of cert.pem"),
    "an expired identity": (lambda folder, by: identity(folder, by, NOW - DAY), "cert.pem is valid only"),
    "permissions unsigned": (
        lambda folder, by: instead(folder, "permissions.p7s", permissions("/robot/cfodi").encode()), "/robot/cfodi"),
    "permissions signed by another": (
        lambda folder, by: instead(folder, "permissions.p7s", Authority().sign(permissions("/robot/cfodi"))), "/robot/cfodi"),
    "permissions altered": (lambda folder, by: altered(folder, "permissions.p7s", b"DENY", b"ALLOW"), "hash"),
    "permissions of another": (
        lambda folder, by: instead(folder, "permissions.p7s", by.sign(permissions("/planner"))), "permissions document"),
    "permissions expired": (
        lambda folder, by: instead(folder, "permissions.p7s", by.sign(permissions("/robot/cfodi", until=NOW - DAY))),
        "permissions document"),
    "governance unsigned": (lambda folder, by: instead(folder, "governance.p7s", governance().encode()), "/robot/cfodi"),
    "governance altered": (
        lambda folder, by: altered(folder, "governance.p7s", b"_participants>false", b"_participants>true"), "hash"),
    "governance that loses clouds": (
        lambda folder, by: instead(folder, "governance.p7s", by.sign(governance(data="ENCRYPT"))), "data_protection_kind"),
}


@pytest.mark.parametrize("spoil, says", BAD.values(), ids=BAD)
def test_bad_keys_end_it_before_a_packet_is_sent(spoil, says, start, keys):
    spoil(keys.folder / "enclaves" / "robot" / "cfodi", keys.authority)
    capture = Capture()
    node = start(arguments=ENCLAVE, environment=keys.variables(), binary=SECURED / "cfodi")
    refused(node, capture, says)


def test_permissive_without_the_feature_or_keys_warns_and_goes_on_unsecured(start, peer, keys):
    for binary, variables, says in [
        (None, {}, "not built in"),
        (SECURED / "cfodi", {"ROS_SECURITY_KEYSTORE": ""}, "ROS_SECURITY_KEYSTORE is not set"),
    ]:
        node = start(arguments=ENCLAVE, environment=keys.variables("Permissive") | variables, binary=binary).ready()
        node.line_with("WARN", "not secured", says)
        recorded = peer.record("/cfodi/clusters", SurfaceClusterArray, qos(1, latched=True))
        recorded.wait("an unsecured map", timeout=60)
        node.stop()


def test_permissive_with_bad_keys_ends_it_too(start, keys):
    identity(keys.folder / "enclaves" / "robot" / "cfodi", Authority())
    capture = Capture()
    node = start(arguments=ENCLAVE, environment=keys.variables("Permissive"), binary=SECURED / "cfodi")
    refused(node, capture, "identity CA")


@pytest.mark.alone  # on busy cores, which it makes itself too, those with keys often do not find each other
def test_who_has_keys_gets_clusters_and_who_has_none_gets_nothing(start, peer, run, keys, large_buffers):
    def enclave(name):
        return ["--ros-args", "--enclave", name]

    outsider = run("clusters")
    stranger = Keystore(keys.folder.parent / "others")
    stranger.enclave("/planner")
    foreign = run("clusters", *enclave("/planner"), environment=stranger.variables())
    unsecured = peer.record("/cfodi/clusters", SurfaceClusterArray, qos(10, latched=True))
    best_effort = peer.record("/cfodi/clusters", SurfaceClusterArray, qos(10, reliable=False))

    def planner_gets_clusters():
        node = start(fixed_frame="odom", points="/points", arguments=ENCLAVE, environment=keys.variables(),
                     binary=SECURED / "cfodi").ready()
        node.line_with("DDS is secured", "/robot/cfodi")
        planner = run("clusters", *enclave("/planner"), environment=keys.variables())
        driver = run("robot", "2", *enclave("/driver"), environment=keys.variables())
        gets = comes(lambda: (clusters_read(planner) or 0) > 5, 45)
        if not gets:
            node.end()
            planner.kill()
            driver.kill()
        return gets

    # RustDDS may lose any of them to what it asks of `foreign`: docs/security.md.
    assert any(planner_gets_clusters() for _ in range(3))
    time.sleep(3)
    for reader in (outsider, foreign):
        assert "reading" in reader.lines and clusters_read(reader) is None
    assert not len(unsecured) and not len(best_effort)
    assert not peer.node.count_publishers("/cfodi/clusters"), "an outsider learned of a topic"


def test_who_has_keys_without_the_permission_gets_nothing_and_who_looks_on_reads_nothing(start, run, keys):
    capture = Capture()
    keys.enclave("/guest", subscribe=("ros_discovery_info", "rq/*", "rr/*", "rt/parameter_events"))
    node = start(arguments=ENCLAVE, environment=keys.variables(), binary=SECURED / "cfodi").ready()
    guest = run("clusters", "--ros-args", "--enclave", "/guest", environment=keys.variables())
    planner = run("clusters", "--ros-args", "--enclave", "/planner", environment=keys.variables())
    wait_until("a map at the planner", lambda: clusters_read(planner) is not None, 60)
    assert guest.wait(60) != 0 and clusters_read(guest) is None
    node.stop()
    packets = capture.stop()
    assert len(packets) > 100
    assert not any(FAREWELL.search(packet) for packet in packets), "it cannot be signed"
    assert not [word for word in PLAIN if any(word in packet for packet in packets)]


@pytest.mark.parametrize("domain, secured", [(0, False), (7, False), (0, True)])
def test_no_port_but_those_of_dds_is_opened(domain, secured, start, peer, keys):
    if secured:
        node = start(arguments=ENCLAVE, environment=keys.variables(), binary=SECURED / "cfodi").ready()
    else:
        node = start(environment={"ROS_DOMAIN_ID": str(domain)}).ready()
    base = 7400 + 250 * domain
    discovery, ours = {base, base + 1}, set(range(base + 10, base + 250))
    opened = sockets(node.process.pid)
    # Sockets that only send have a port of the system's choice.
    first, last = map(int, pathlib.Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split())
    fixed = [(protocol, port) for protocol, port in opened if not first <= port <= last]
    assert {protocol for protocol, _ in opened} <= {"udp", "udp6"}, opened
    assert any(port in discovery for _, port in fixed) and any(port in ours for _, port in fixed), opened
    assert all(port in discovery | ours for _, port in fixed), opened
