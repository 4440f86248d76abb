"""Depth images in: at 30 Hz on a small socket buffer, in every form, and one input at a time."""

import time

import clouds
import compare
import depth_images
import network
import numpy as np
import pytest
from cfodi_node import accounted
from diagnostic_msgs.msg import DiagnosticArray
from drives import attempts, drive, is_good
from peer import qos, send_until, wait_until
from sensor_msgs.msg import CameraInfo

STOCK_BUFFER = 212_992  # net.core.rmem_max of a Linux that nobody has tuned: holds six datagrams of 64 KB
ENOUGH_FOR_RAW = 2 * STOCK_BUFFER  # a raw image of 640x480 is ten such datagrams, sent at once
IMAGE, INFO = "/camera/depth/image_raw", "/camera/depth/camera_info"
REMAPS = {"depth/image": IMAGE, "depth/camera_info": INFO}


def begin(start, peer, suffix="", **more):
    """The node, recorded, and a depth camera that it hears."""
    node = start(remaps=REMAPS, **more).ready()
    peer.record_node()
    camera = peer.depth_camera(depth_images.wall_info(), suffix)
    camera.meet()
    return node, camera


def take_in(camera, peer, image):
    stamp, before = time.time_ns(), len(peer.deltas)
    camera.publish(image, stamp, clouds.still_transform())
    return peer.deltas.wait("the delta of a good image", lambda m: compare.stamp(m) == stamp, after=before)


def send_wall(camera):
    camera.publish(depth_images.image(depth_images.wall()), time.time_ns(), clouds.still_transform())


@pytest.mark.alone
@pytest.mark.timeout(400)
@pytest.mark.parametrize("kind, buffer", [
    (["--kind=compressed"], STOCK_BUFFER),
    (["--kind=depth", "--reliable"], STOCK_BUFFER),
    (["--kind=depth"], ENOUGH_FOR_RAW),
], ids=["compressed", "raw-reliable", "raw"])
def test_at_30_hz_95_percent_are_taken_in_on_a_small_socket_buffer(kind, buffer, recordings, start):
    if (granted := network.granted_buffer(buffer)) < buffer:
        pytest.fail(f"the kernel grants {granted} bytes to a socket: sysctl -w net.core.rmem_max={buffer}")
    for _ in attempts():
        node = start({"receive_buffer": buffer}, remaps=REMAPS).ready()
        played, counts = drive(node, 1, str(recordings), *kind, "--seconds=20")
        # When the last image is the one that is lost, no later number tells.
        assert played["sent"] - 1 <= accounted(counts) <= played["sent"]
        if is_good(played, counts, 0.95):
            break
    assert is_good(played, counts, 0.95), (played, counts)


@pytest.mark.parametrize("kind", [np.uint16, np.float32])
@pytest.mark.parametrize("form, suffix", [(depth_images.image, ""), (depth_images.compressed, "/compressedDepth")])
def test_a_wall_is_a_wall_in_every_form(form, suffix, kind, start, peer):
    node, camera = begin(start, peer, suffix)
    delta = take_in(camera, peer, form(depth_images.wall(kind)))
    largest = max(delta.clusters, key=lambda cluster: cluster.voxel_count)
    # The camera looks along x of the map from the origin, 1 m up.
    assert abs(abs(largest.plane.coef[0]) - 1) < 1e-3 and abs(abs(largest.plane.coef[3]) - 2.04) < 0.01, largest.plane
    assert abs(max(largest.size.x, largest.size.y) - 2.04) < 0.2, largest.size
    counts = node.stop()
    assert counts["taken_in"] == 1 and not counts["skipped"], counts
    assert any(f"scans are made of {IMAGE + suffix}" in line for line in node.lines)


def test_images_before_the_first_camera_info_are_counted(start, peer):
    node, camera = begin(start, peer)
    info, camera.info = camera.info, None
    for _ in range(3):
        send_wall(camera)
        time.sleep(0.3)
    node.line_with("camera_info")
    camera.info = info
    camera._info.publish(info)
    time.sleep(0.5)
    take_in(camera, peer, depth_images.image(depth_images.wall()))
    counts = node.stop()
    assert counts["skipped"] == {"no_camera_info": 3} and counts["taken_in"] == 1, counts


def test_a_camera_info_that_was_said_once_before_the_node_began_is_heard(start, peer):
    info = peer.node.create_publisher(CameraInfo, INFO, qos(1, latched=True))
    info.publish(depth_images.wall_info())
    node, camera = begin(start, peer)
    camera.info = None
    # It comes with a heartbeat, up to 3 s after the two have found each other.
    send_until("the delta of an image", lambda: send_wall(camera), lambda: len(peer.deltas))
    assert node.stop()["taken_in"] > 0


def test_a_camera_info_of_another_name_is_named_with_the_words_that_choose_it(start, peer):
    node = start(remaps={"depth/image": IMAGE}).ready()
    reports = peer.record("/diagnostics", DiagnosticArray, qos(100))
    camera = peer.depth_camera(depth_images.wall_info())
    wait_until("the node", camera._cloud.get_subscription_count)
    time.sleep(1)
    words = "nobody publishes a CameraInfo on /depth/camera_info: use -r depth/camera_info:=" + INFO

    def has_the_error(report):
        sensor = "cfodi: sensor points"
        return any(s.name == sensor and s.level == b"\2" and words in s.message for s in report.status)

    def are_there():
        return node.said(f"a scan of {IMAGE} was skipped: ", words) and any(map(has_the_error, reports))

    # They are said after three seconds of such images; a line that repeats is said every five.
    send_until("a line and an error with these words", lambda: send_wall(camera), are_there)
    assert node.stop()["taken_in"] == 0


def test_bad_images_are_counted_by_reason_and_the_next_good_one_is_taken_in(start, peer):
    node, camera = begin(start, peer)
    good = depth_images.image(depth_images.wall())
    camera._info.publish(camera.info)
    time.sleep(0.5)
    bad = [depth_images.image(depth_images.wall()[:50]), good.replace(b"16UC1\0", b"bgr8x\0"), good[:100]]
    for data in bad:
        camera.publish(data, time.time_ns(), clouds.still_transform())
        time.sleep(0.3)
    take_in(camera, peer, good)
    counts = node.stop()
    assert counts["skipped"] == {"image_size": 1, "unknown_encoding": 1, "undecodable": 1}, counts
    assert counts["taken_in"] == 1 and counts["lost"] == 0, counts


def test_a_camera_info_that_projects_nothing_is_said_and_counted(start, peer):
    node, camera = begin(start, peer)
    camera.info = depth_images.camera_info(160, 120, 0.0, 0.0, 0.0, 0.0)
    camera._info.publish(camera.info)
    time.sleep(0.5)
    send_wall(camera)
    node.line_with(INFO, "fx 0")
    time.sleep(0.5)
    assert node.stop()["skipped"] == {"bad_intrinsics": 1}


def test_the_first_input_is_the_only_one_and_it_is_said_how_to_choose(start, peer):
    node, camera = begin(start, peer)
    points = peer.camera()
    points.meet()
    take_in(camera, peer, depth_images.image(depth_images.wall()))
    for _ in range(3):
        points.publish(clouds.cloud(clouds.wall()), time.time_ns(), clouds.still_transform())
        time.sleep(0.3)
    node.line_with("/camera/depth/points is skipped", "-r depth/image:=/unused")
    take_in(camera, peer, depth_images.image(depth_images.wall()))
    counts = node.stop()
    assert counts["skipped"] == {"other_input": 3} and counts["taken_in"] == 2, counts


def test_a_driver_that_comes_back_in_another_form_is_taken_in_that(start, peer):
    """Raw images first, then compressed ones alone, then clouds."""
    node, camera = begin(start, peer)
    take_in(camera, peer, depth_images.image(depth_images.wall()))
    compressed = IMAGE + "/compressedDepth"
    for gone, after, scan in [
            (IMAGE, lambda: peer.depth_camera(depth_images.wall_info(), "/compressedDepth"),
             depth_images.compressed(depth_images.wall())),
            (compressed, peer.camera, clouds.cloud(clouds.wall()))]:
        peer.node.destroy_publisher(camera._cloud)
        node.line_with(f"nobody publishes on {gone} any more")
        camera = after()
        camera.meet()
        take_in(camera, peer, scan)
    for topic in (compressed, "/camera/depth/points"):
        node.line_with(f"scans are made of {topic}")
    counts = node.stop()
    assert counts["taken_in"] == 3 and not counts["skipped"], counts


def cameras(peer):
    """What `image_transport` offers of one camera: its images raw and compressed."""
    return [peer.depth_camera(depth_images.wall_info(), suffix) for suffix in ("", "/compressedDepth")]


def test_compressed_images_are_not_read_beside_raw_ones(start, peer):
    """Where somebody reads them, the driver packs a PNG of each image."""
    node = start(remaps=REMAPS).ready()
    peer.record_node()
    raw, packed = cameras(peer)
    raw.meet()
    for _ in range(15):
        take_in(raw, peer, depth_images.image(depth_images.wall()))
        assert packed._cloud.get_subscription_count() == 0
        time.sleep(0.8)
    counts = node.stop()
    assert counts["taken_in"] == 15 and not counts["skipped"], counts


def test_compressed_images_are_read_where_raw_ones_are_offered_and_no_good_one_comes(start, peer):
    node = start(remaps=REMAPS).ready()
    peer.record_node()
    raw, packed = cameras(peer)
    raw.meet()
    raw.publish(depth_images.image(depth_images.wall()[:50]), time.time_ns(), clouds.still_transform())
    packed.meet()
    take_in(packed, peer, depth_images.compressed(depth_images.wall()))
    node.line_with(f"scans are made of {IMAGE}/compressedDepth")
    counts = node.stop()
    assert counts["taken_in"] == 1 and counts["skipped"] == {"image_size": 1}, counts


def test_compressed_images_are_read_no_more_once_raw_ones_come(start, peer):
    """A Kinect that is plugged in long after its driver has offered both. That nobody reads a topic any more Fast DDS does not hear of
    RustDDS, so that the driver packs on; the node unpacks nothing."""
    node = start(remaps=REMAPS).ready()
    peer.record_node()
    raw, packed = cameras(peer)
    raw.meet()
    packed.meet()
    take_in(raw, peer, depth_images.image(depth_images.wall()))
    node.line_with(f"{IMAGE}/compressedDepth is read no more")
    time.sleep(1)
    for _ in range(5):
        packed.publish(depth_images.compressed(depth_images.wall()), time.time_ns(), clouds.still_transform())
        take_in(raw, peer, depth_images.image(depth_images.wall()))
    counts = node.stop()
    assert counts["received"] == counts["taken_in"] == 6 and not counts["skipped"], counts
