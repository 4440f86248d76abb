"""What any process in the domain can send: the node lives through it, and takes in the next good cloud."""

import pathlib
import random
import re
import socket
import struct
import time

import clouds
import depth_images
import numpy as np
import pytest
from builtin_interfaces.msg import Time
from cfodi_node import accounted
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from peer import qos, send_until, until_taken_in, wait_until
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from rtps import GAP, HEARTBEAT, submessages
from sensor_msgs.msg import CameraInfo
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

MEGABYTE = "x" * (1 << 20)
NAN, INF, MOST = float("nan"), float("inf"), 1.7976931348623157e308


def begin(start, peer, **more):
    node = start(**more).ready()
    peer.record_node()
    camera = peer.camera()
    camera.meet()
    return node, camera


def take_in(camera, peer, cloud=None, transform=None):
    """A good cloud, sent until its delta comes: what was hostile may still be on its way before it."""
    def send():
        return camera.publish(cloud or clouds.cloud(clouds.wall()), time.time_ns(), transform or clouds.still_transform())

    return until_taken_in(send, peer.deltas)


def survived(node, camera, peer):
    """It lives, takes in what is good, and says where everything went."""
    take_in(camera, peer)
    is_the_same(node)
    counts = node.stop()
    is_the_same(node)
    return counts


def is_the_same(node):
    """No thread of it has died, and it has not begun anew either, which would keep its process id."""
    assert node.process.poll() in (None, 0)
    assert not any(words in line for line in node.lines for words in ("panicked", "begins anew")), node.lines


def garbage(rng):
    """Bytes behind a good CDR header, and behind none."""
    return [bytes([0, 1, 0, 0]) + rng.randbytes(length) for length in (0, 1, 7, 64, 500)] + [b"", rng.randbytes(3), rng.randbytes(80)]


def transform(parent="map", child="camera_link", stamp=Time(), rotation=(0.0, 0.0, 0.0, 1.0), translation=(0.0, 0.0, 1.0)):
    (x, y, z), (qx, qy, qz, qw) = translation, rotation
    return TransformStamped(header=Header(frame_id=parent, stamp=stamp), child_frame_id=child, transform=Transform(
        translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=qx, y=qy, z=qz, w=qw)))


HOSTILE_TRANSFORMS = {
    "quaternions of nothing": [transform(rotation=r) for r in [
        (0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0), (NAN, 0.0, 0.0, 1.0), (0.0, 0.0, INF, 0.0), (MOST, 0.0, 0.0, 0.0)]],
    "translations of nowhere": [transform(translation=t) for t in [
        (NAN, 0.0, 0.0), (INF, 0.0, 0.0), (MOST, -MOST, MOST), (5e-324, 0.0, 0.0)]],
    "names of a megabyte": [transform(child=MEGABYTE), transform(parent=MEGABYTE)],
    "no names": [transform(child=""), transform(parent=""), transform(parent="/", child="//")],
    "its own parent": [transform(parent="camera_link"), transform(parent="/camera_link")],
    "a cycle": [transform("a", "b"), transform("b", "c"), transform("c", "a")],
    "stamps that cannot be": [transform(stamp=Time(sec=5, nanosec=2**32 - 1))],
    "stamps of 1901 and 2038": [transform(stamp=Time(sec=-2**31)), transform(stamp=Time(sec=2**31 - 1, nanosec=999_999_999))],
    "lines in names": [transform("map\ncounts {\"received\":0}", "\x1b[2Jcamera")],
}


@pytest.mark.timeout(300)
def test_transforms_that_cannot_be_cost_themselves(start, peer):
    node, camera = begin(start, peer)
    for hostile in HOSTILE_TRANSFORMS.values():
        for latched in (False, True):
            publisher = camera._tf_static if latched else camera._tf
            publisher.publish(TFMessage(transforms=hostile))
        time.sleep(0.1)
    for data in garbage(random.Random(1)):
        camera._tf.publish(data)
    camera._tf_static.publish(clouds.static_transform())
    time.sleep(1)
    survived(node, camera, peer)
    assert not any("\x1b[2J" in line or line.startswith("counts {\"received\":0") for line in node.lines)


@pytest.mark.timeout(300)
def test_thousands_of_frames_and_a_chain_of_hundreds_are_bounded(start, peer):
    node, camera = begin(start, peer)
    now = time.time_ns()
    stamp = Time(sec=now // 10**9, nanosec=now % 10**9)
    chain = [transform(f"link{i}", f"link{i + 1}", stamp) for i in range(500)]
    camera._tf.publish(TFMessage(transforms=chain))
    time.sleep(0.5)
    for group in range(12):
        many = [transform("map", f"frame{group}_{i}", stamp) for i in range(1000)]
        camera._tf.publish(TFMessage(transforms=many))
        time.sleep(0.1)
    camera.publish(clouds.cloud(clouds.wall(), frame_id="link400"), now, clouds.still_transform())
    camera._tf_static.publish(clouds.static_transform())
    time.sleep(1)
    survived(node, camera, peer)
    assert any("10000 frames are kept" in line for line in node.lines) and any("frames above it" in line for line in node.lines)


@pytest.mark.timeout(300)
def test_clouds_at_the_ends_of_numbers_and_time_are_taken_by_point_or_refused(start, peer):
    node, camera = begin(start, peer)
    ends = np.array([[[3.4e38, 3.4e38, 1.0, 0.0], [-3.4e38, 0.0, 1.0, 0.0], [1e-45, -1e-45, 1.0, 0.0], [NAN, INF, 1.0, 0.0],
                      [0.08, 0.08, 1.0, 0.0], [-0.08, 0.0, 0.96, 0.0]]], np.float32)
    take_in(camera, peer, clouds.cloud(ends))
    for seconds in (-2**31, -1, 0, 2**31 - 1):
        camera.publish(clouds.cloud(clouds.wall()), seconds * 10**9, clouds.still_transform())
    camera.publish_as_is(clouds.cloud(clouds.wall(), frame_id=MEGABYTE))
    late = bytearray(clouds.cloud(clouds.wall()))
    struct.pack_into("<I", late, 8, 2**32 - 1)  # nanoseconds in a second
    camera.publish_as_is(bytes(late))
    for data in garbage(random.Random(2)):
        camera.publish_as_is(data)
    time.sleep(1)
    counts = survived(node, camera, peer)
    assert counts["skipped"]["bad_stamp"] == 1 and counts["skipped"]["undecodable"] >= 6, counts
    assert accounted(counts) <= camera.sent, counts


@pytest.mark.timeout(300)
def test_camera_infos_that_cannot_be_cost_themselves(start, peer):
    info_topic = "/camera/depth/camera_info"
    node = start(remaps={"depth/image": "/camera/depth/image_raw", "depth/camera_info": info_topic}).ready()
    peer.record_node()
    good, image = depth_images.wall_info(), depth_images.image(depth_images.wall())
    camera = peer.depth_camera(good)
    camera.meet()
    bad = [depth_images.camera_info(160, 120, *numbers) for numbers in [
        (0.0, 0.0, 0.0, 0.0), (NAN, 160.0, 80.0, 60.0), (-160.0, 160.0, 80.0, 60.0), (160.0, INF, 80.0, 60.0),
        (160.0, 160.0, NAN, 60.0), (5e-324, 160.0, 80.0, 60.0), (MOST, MOST, MOST, MOST)]]
    bad.append(depth_images.camera_info(2**32 - 1, 2**32 - 1, 160.0, 160.0, 80.0, 60.0))
    bad.append(bytes(serialize_message(CameraInfo(width=160, height=120, d=[NAN] * 50_000))))
    bad += garbage(random.Random(3))
    for info in bad * 3:  # of what comes in haste not every one is read
        camera._info.publish(info)
        time.sleep(0.05)
        camera.publish_as_is(clouds.stamped(image, clouds.CLOUD_STAMP, time.time_ns()))
        time.sleep(0.05)
    for data in garbage(random.Random(4)):
        camera.publish_as_is(data)
    time.sleep(0.5)
    camera._info.publish(good)
    time.sleep(0.5)
    take_in(camera, peer, image)
    assert node.process.poll() is None and not any("panicked" in line for line in node.lines), node.lines
    counts = node.stop()
    assert {"bad_intrinsics", "image_size", "undecodable"} <= set(counts["skipped"]), counts


@pytest.mark.timeout(300)
def test_a_clock_that_cannot_be_does_no_harm(start, peer):
    node, camera = begin(start, peer, parameters={"use_sim_time": "true"})
    clock = peer.node.create_publisher(Clock, "/clock", qos(10, reliable=False))
    wait_until("a subscription of /clock", clock.get_subscription_count)

    def send():
        for seconds in (2**31 - 1, -2**31, 0, 1, 2**31 - 1):
            clock.publish(Clock(clock=Time(sec=seconds, nanosec=999_999_999)))
            time.sleep(0.05)

    send_until("a line of a jump", send, lambda: node.said("/clock has jumped back"))
    clock.publish(Clock(clock=Time(sec=1, nanosec=2**32 - 1)))
    for data in garbage(random.Random(5)):
        if len(data) <= 12:  # Fast DDS sends no more than the type can have
            clock.publish(data)
    survived(node, camera, peer)


@pytest.mark.timeout(300)
def test_a_flood_of_calls_leaves_the_node_alive(start, peer):
    node, camera = begin(start, peer)
    client = peer.node.create_client(Trigger, "/cfodi/reset")
    assert client.wait_for_service(60)
    calls = [client.call_async(Trigger.Request()) for _ in range(300)]
    wait_until("some answers", lambda: sum(call.done() for call in calls) > 5)
    assert peer.call(Trigger, "/cfodi/reset", Trigger.Request()).success
    survived(node, camera, peer)


def value(kind, **fields):
    return ParameterValue(type=kind, **fields)


@pytest.mark.timeout(300)
def test_no_value_of_any_type_changes_a_parameter(start, peer):
    node, camera = begin(start, peer)
    listed = peer.call(ListParameters, "/cfodi/list_parameters", ListParameters.Request()).result.names
    names = list(listed)
    before = peer.call(GetParameters, "/cfodi/get_parameters", GetParameters.Request(names=names)).values
    t = ParameterType
    values = [
        value(t.PARAMETER_NOT_SET), value(t.PARAMETER_BOOL, bool_value=True), value(t.PARAMETER_INTEGER, integer_value=-2**63),
        value(t.PARAMETER_DOUBLE, double_value=NAN), value(t.PARAMETER_STRING, string_value="x" * 10_000),
        value(t.PARAMETER_BYTE_ARRAY, byte_array_value=[b"\x00"] * 100),
        value(t.PARAMETER_DOUBLE_ARRAY, double_array_value=[INF] * 100),
        value(t.PARAMETER_STRING_ARRAY, string_array_value=["\x1b[2J\n"] * 100), value(77)]
    unknown = ["", "no_such", "\n", "x" * 10_000]
    for each in values:
        # `optical` is a text, but yes and no in YAML are booleans: true is meant, and taken.
        meant = {"optical"} if each.type == t.PARAMETER_BOOL else set()
        wanted = [Parameter(name=name, value=each) for name in [*names, *unknown] if name not in meant]
        request = SetParameters.Request(parameters=wanted)
        results = peer.call(SetParameters, "/cfodi/set_parameters", request).results
        assert len(results) == len(wanted)
        assert not any(result.successful for result in results[-len(unknown):]), results
    peer.call(GetParameters, "/cfodi/get_parameters", GetParameters.Request(names=unknown))
    peer.call(DescribeParameters, "/cfodi/describe_parameters", DescribeParameters.Request(names=unknown))
    after = peer.call(GetParameters, "/cfodi/get_parameters", GetParameters.Request(names=names)).values
    assert after == before
    survived(node, camera, peer)


def ports():
    """The UDP ports that somebody listens on in this network."""
    lines = open("/proc/thread-self/net/udp").read().splitlines()[1:]
    return {int(line.split()[1].split(":")[1], 16) for line in lines}


def sniff(seconds, meanwhile):
    """UDP payloads on `lo`."""
    heard, end = [], time.monotonic() + seconds
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x0003)) as raw:
        raw.settimeout(0.2)
        while time.monotonic() < end:
            meanwhile()
            try:
                frame = raw.recv(1 << 16)
            except TimeoutError:
                continue
            if len(frame) > 46 and frame[42:46] == b"RTPS":
                heard.append(frame[42:])
    return heard


def has_a_forged_range(packet):
    """Whether a `HEARTBEAT` or a `GAP` in it tells of more than a million messages: two numbers behind two entities."""
    for at, kind, order, _ in submessages(packet):
        if kind in (HEARTBEAT, GAP) and at + 28 <= len(packet):
            high, low, last_high, last_low = struct.unpack_from(order + "iIiI", packet, at + 12)
            if (last_high - high << 32) + last_low - low > 1 << 20:
                return True
    return False


def mutated(packet, rng):
    data = bytearray(packet)
    for _ in range(rng.randrange(1, 8)):
        at = rng.randrange(4, len(data))
        what = rng.randrange(4)
        if what == 0:
            data[at] = rng.randrange(256)
        elif what == 1:
            data[at:at + 4] = rng.choice([b"\xff" * 4, b"\0" * 4, b"\xff\xff\xff\x7f", b"\0\0\0\x80"])
        elif what == 2 and at > 24:
            del data[at:]
        else:
            data[at:at] = rng.randbytes(rng.randrange(1, 9))
    return bytes(data)


@pytest.mark.timeout(300)
def test_datagrams_of_garbage_leave_the_node_alive(start, peer):
    nobody = ports()
    node, camera = begin(start, peer)
    rng = random.Random(6)
    packets = sniff(3, lambda: camera.publish(clouds.cloud(clouds.wall(side=20)), time.time_ns(), clouds.still_transform()))
    assert len(packets) > 20, "nothing was heard that could be changed"
    assert ports() - nobody
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for port in ports() - nobody:
            for _ in range(300):
                out.sendto(rng.randbytes(rng.randrange(0, 200)), ("127.0.0.1", port))
                out.sendto(b"RTPS\x02\x04" + rng.randbytes(rng.randrange(0, 300)), ("127.0.0.1", port))
            changed = [mutated(rng.choice(packets), rng) for _ in range(1500)]
            changed = [packet for packet in changed if not has_a_forged_range(packet)]  # what those do is the next test's
            assert len(changed) > 1400, f"{len(changed)} of 1500 are without a forged range"
            for packet in changed:
                out.sendto(packet, ("127.0.0.1", port))
            time.sleep(0.2)
    time.sleep(1)
    survived(node, camera, peer)


def heartbeats(packets):
    """Header and `HEARTBEAT` (DDSI-RTPS 2.5, 8.3.8.6) of each writer: what the last such packet of it has."""
    found = {}
    for packet in packets:
        for at, kind, order, length in submessages(packet):
            if kind == HEARTBEAT and order == "<" and length == 28:
                found[packet[8:20] + packet[at + 8:at + 12]] = packet[:20], packet[at:at + 32]
    return found.values()


def forged_heartbeat(header, heartbeat):
    """The same, where the writer has messages up to the number 2^62."""
    return header + heartbeat[:20] + struct.pack("<iIi", 1 << 30, 0, 1 << 20)


def forged_gap(header, heartbeat):
    """A `GAP` (8.3.8.4) of that writer, by which its messages from 2^20 up to 2^62 will never come."""
    return header + struct.pack("<BBH", GAP, 1, 28) + heartbeat[4:12] + struct.pack("<iIiII", 0, 1 << 20, 1 << 30, 0, 0)


@pytest.mark.alone
@pytest.mark.timeout(300)
@pytest.mark.parametrize("forged", [forged_heartbeat, forged_gap])
def test_a_forged_range_that_holds_the_middleware_costs_seconds_and_no_map(start, peer, tmp_path, forged):
    nobody = ports()
    node, camera = begin(start, peer, parameters={"snapshot_path": tmp_path / "map"})
    packets = sniff(3, lambda: camera.publish(clouds.cloud(clouds.wall(side=20)), time.time_ns(), clouds.still_transform()))
    take_in(camera, peer)
    before = peer.clusters.wait("a snapshot", lambda m: m.clusters)
    process, seen = node.process.pid, len(peer.clusters)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for header, heartbeat in heartbeats(packets):
            for port in ports() - nobody:
                out.sendto(forged(header, heartbeat), ("127.0.0.1", port))
    node.line_with("the middleware has not answered for 5 s: the process begins anew in its place, with the map of")
    assert re.search(r" resumed: [1-9]\d* voxels", node.line_with("resumed: "))
    after = peer.clusters.wait("the map that was saved", lambda m: m.session_id != before.session_id, 20, seen)
    assert after.sequence >= before.sequence > 0
    assert {cluster.id for cluster in before.clusters} <= {cluster.id for cluster in after.clusters}
    take_in(camera, peer)
    assert node.process.poll() is None and node.process.pid == process
    resident = re.search(r"VmRSS:\s+(\d+) kB", pathlib.Path(f"/proc/{process}/status").read_text())
    assert int(resident[1]) < 300_000, "what the middleware took is not given back"
    node.stop()
