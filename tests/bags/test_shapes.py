"""Bags of other shapes than those of the recordings, written message by message."""

import bags
import numpy as np
import pytest
import recount
import scene
from bags import Bag
from replay import Replay, cfodi, same_map

PAPER = {"mode": "paper"}


@pytest.fixture(scope="session")
def clouds(space):
    """The scene as clouds: what every other shape of it must lead to."""
    return scene.write(space / "scene-clouds", scene.cloud)


@pytest.fixture(scope="session")
def images(space):
    return scene.write(space / "scene-images", scene.image)


@pytest.fixture(scope="session")
def counted(clouds):
    return recount.Voxels(clouds, bags.POINTS)


def test_the_scene_itself_is_taken_in(clouds, counted, tmp_path):
    run = Replay(clouds, tmp_path, parameters=PAPER)
    assert run.summary()["scans"] == scene.SCANS and len(run.voxels()) > 100
    recount.assert_same_voxels(run.voxels(), counted)


def test_a_depth_image_becomes_the_cloud_that_depth_image_proc_makes(images, counted, tmp_path):
    run = Replay(images, tmp_path, parameters=PAPER)
    assert run.summary()["scans"] == scene.SCANS
    recount.assert_same_voxels(run.voxels(), counted)


def test_the_shape_of_tums_recordings(counted, tmp_path):
    """Leading slashes, tf/tfMessage, all transforms on /tf, float images under `image`, and `/world` as the root."""
    frame = "/openni_rgb_optical_frame"
    with Bag(tmp_path / "tum") as bag:
        scene.moves(bag, "/world", "/kinect", kind=bags.OLD_TF)
        for stamp in range(scene.START - bags.SECOND, scene.START + bags.SECOND, bags.SECOND // 20):
            bag.transform(stamp, "/kinect", "/openni_camera", kind=bags.OLD_TF)
            bag.transform(stamp, "/openni_camera", "/openni_rgb_frame", kind=bags.OLD_TF)
            bag.transform(stamp, "/openni_rgb_frame", frame, rotation=bags.LINK_FROM_OPTICAL, kind=bags.OLD_TF)
        for scan, stamp in enumerate(scene.stamps()):
            bag.info(stamp, scene.WIDTH, scene.HEIGHT, scene.FOCAL, frame=frame)
            bag.image(stamp, scene.metres(scene.depth(scan)), topic="/camera/depth/image", frame=frame)
    run = Replay(tmp_path / "tum", tmp_path, parameters=PAPER)
    assert run.summary()["scans"] == scene.SCANS
    assert run.summary()["parameters"]["fixed_frame"] == "world" and "world" in run.stderr
    recount.assert_same_voxels(run.voxels(), counted)
    named = Replay(tmp_path / "tum", tmp_path / "named", outputs=("voxels",),
                   parameters=PAPER | {"fixed_frame": "/world"})
    assert named.bytes("voxels") == run.bytes("voxels")


@pytest.mark.parametrize("topic", ["/camera/depth/image_raw/compressedDepth", "/camera/depth/image_raw/compressed"])
def test_png_images_give_what_raw_ones_give(topic, images, tmp_path):
    def sensor(bag, stamp, scan):
        bag.info(stamp, scene.WIDTH, scene.HEIGHT, scene.FOCAL)
        bag.compressed(stamp, scene.depth(scan), topic)

    packed = scene.write(tmp_path / "packed", sensor)
    same_map(Replay(packed, tmp_path / "a", topics=[topic], parameters=PAPER),
             Replay(images, tmp_path / "b", parameters=PAPER))


@pytest.mark.parametrize("rules", [
    ["-r", f"depth/image:={bags.IMAGE}"],
    ["-r", "depth/image:=/unused", "-r", f"/unused/compressedDepth:={bags.IMAGE}/compressedDepth",
     "-r", f"depth/camera_info:={bags.INFO}"],
    ["-p", "sensors:=[rear]", "-p", "rear.kind:=depth", "-r", f"rear/image:={bags.IMAGE}"],
], ids=["beside", "by its own name", "listed"])
def test_png_images_are_found_where_the_live_node_finds_them(rules, tmp_path):
    def sensor(bag, stamp, scan):
        bag.info(stamp, scene.WIDTH, scene.HEIGHT, scene.FOCAL)
        bag.compressed(stamp, scene.depth(scan), bags.IMAGE + "/compressedDepth")

    packed = scene.write(tmp_path / "packed", sensor)
    run = Replay(packed, tmp_path, "--ros-args", *rules, outputs=("summary",))
    assert run.summary()["scans"] == scene.SCANS and f"reading {bags.IMAGE}/compressedDepth with {bags.INFO}" in run.stderr


def test_float_images_packed_by_their_inverse_are_unpacked(tmp_path):
    """image_transport's compressedDepth of a 32FC1 image, with its usual parameters (depth_quantization 100, 10 m)."""
    a = np.float32(100 * 101)
    inverse = a, np.float32(1 - a / 10)
    topic = bags.IMAGE + "/compressedDepth"

    def values(scan):
        z = scene.metres(scene.depth(scan))
        return np.where(np.isfinite(z), inverse[0] / np.nan_to_num(z, nan=1) + inverse[1], 0).astype(np.uint16)

    def packed(bag, stamp, scan):
        bag.info(stamp, scene.WIDTH, scene.HEIGHT, scene.FOCAL)
        bag.compressed(stamp, values(scan), topic, inverse=inverse)

    def unpacked(bag, stamp, scan):
        z = values(scan).astype(np.float32)
        bag.cloud(stamp, scene.points(np.where(z > 0, inverse[0] / (z - inverse[1]), np.nan).astype(np.float32)))

    run = Replay(scene.write(tmp_path / "packed", packed), tmp_path, topics=[topic], parameters=PAPER)
    assert run.summary()["scans"] == scene.SCANS
    clouds = scene.write(tmp_path / "clouds", unpacked)
    recount.assert_same_voxels(run.voxels(), recount.Voxels(clouds, bags.POINTS), allowed=1e-4)


def test_the_sensor_is_that_of_its_kind(tmp_path):
    """`points.kind` without a list of sensors, as the live node takes it: depth images of `points/image`."""
    with Bag(tmp_path / "both") as bag:
        bag.static(scene.START - bags.SECOND)
        scene.moves(bag, "odom")
        for scan, stamp in enumerate(scene.stamps()):
            scene.cloud(bag, stamp, scan, topic="/points")
            bag.info(stamp, scene.WIDTH, scene.HEIGHT, scene.FOCAL, topic="/points/camera_info")
            bag.image(stamp, scene.depth(scan), topic="/points/image")
    for kind, read in [("cloud", "reading /points\n"), ("depth", "reading /points/image with /points/camera_info")]:
        run = Replay(tmp_path / "both", tmp_path, parameters=PAPER | {"points.kind": kind}, outputs=("summary",))
        assert read in run.stderr and run.summary()["scans"] == scene.SCANS


def test_why_hardly_a_point_is_used_is_said_and_counted(clouds, tmp_path):
    run = Replay(clouds, tmp_path, parameters={"max_range": 0.5}, outputs=("summary",))
    summary = run.summary()
    assert summary["points_valid"] == 0 < summary["points_invalid"] < summary["points_out_of_range"]
    assert summary["points_invalid"] + summary["points_out_of_range"] == summary["points"]
    assert summary["clouds_hardly_used"] == scene.SCANS
    assert run.stderr.count("points only 0 can be used") == 1 and "max_range" in run.stderr
    assert f"({summary['points_invalid']} invalid, {summary['points_out_of_range']} out of range)" in run.stderr


def test_static_transforms_that_come_after_five_clouds_hold_for_those_too(clouds, tmp_path):
    with Bag(tmp_path / "late") as bag:
        scene.moves(bag)
        for scan, stamp in enumerate(scene.stamps()):
            scene.cloud(bag, stamp, scan)
            if scan == 4:
                bag.static(stamp + 1)
    run = Replay(tmp_path / "late", tmp_path, parameters=PAPER)
    assert run.summary()["scans"] == scene.SCANS, run.summary()["scans_skipped"]
    same_map(run, Replay(clouds, tmp_path / "early", parameters=PAPER))


def test_clouds_may_come_before_their_transform_of_the_same_time(tmp_path):
    for name in ("behind", "ahead"):
        with Bag(tmp_path / name) as bag:
            bag.static(scene.START - 1)
            for scan, stamp in enumerate(scene.stamps()):
                if name == "ahead":
                    bag.transform(stamp, "map", "camera_link", *scene.pose(stamp))
                scene.cloud(bag, stamp, scan)
                if name == "behind":
                    bag.transform(stamp, "map", "camera_link", *scene.pose(stamp))
    behind, ahead = (Replay(tmp_path / name, tmp_path / f"{name}-out", parameters=PAPER)
                     for name in ("behind", "ahead"))
    assert behind.summary()["scans"] == scene.SCANS
    same_map(behind, ahead)


def test_a_cloud_beyond_its_transforms_is_skipped_and_counted(tmp_path):
    with Bag(tmp_path / "short") as bag:
        bag.static(scene.START - 1)
        for stamp in (scene.START, scene.stamps()[5]):
            bag.transform(stamp, "map", "camera_link", *scene.pose(stamp))
        for scan, stamp in enumerate(scene.stamps()):
            scene.cloud(bag, stamp, scan)
    run = Replay(tmp_path / "short", tmp_path, parameters=PAPER)
    assert run.summary()["scans"] == 6 and sum(run.summary()["scans_skipped"].values()) == scene.SCANS - 6
    recount.assert_same_voxels(run.voxels(), recount.Voxels(tmp_path / "short", bags.POINTS))


def test_two_sensors_fill_one_map(tmp_path):
    topics = "/front/points", "/back/points"

    def sensor(bag, stamp, scan):
        scene.cloud(bag, stamp, scan, topic=topics[0])
        scene.cloud(bag, stamp + 7_000_000, scan, topic=topics[1], frame="back_optical_frame")

    with Bag(tmp_path / "two") as bag:
        bag.static(scene.START - 1)
        bag.static(scene.START - 1, child="back_optical_frame", rotation=(0.5, 0.5, -0.5, -0.5))
        scene.moves(bag)
        for scan, stamp in enumerate(scene.stamps()):
            sensor(bag, stamp, scan)
    run = Replay(tmp_path / "two", tmp_path, topics=topics, parameters=PAPER)
    counted = recount.Voxels(tmp_path / "two", *topics)
    assert run.summary()["scans"] == counted.scans == 2 * scene.SCANS
    recount.assert_same_voxels(run.voxels(), counted)
    for topic in topics:
        one = Replay(tmp_path / "two", tmp_path / topic[1:6], topics=[topic], parameters=PAPER)
        recount.assert_same_voxels(one.voxels(), recount.Voxels(tmp_path / "two", topic))


def test_two_sensors_and_no_choice_are_never_mixed_in_silence(tmp_path):
    """It asks which, and names both."""
    with Bag(tmp_path / "two") as bag:
        bag.static(scene.START - 1)
        scene.moves(bag)
        for scan, stamp in enumerate(scene.stamps()):
            scene.cloud(bag, stamp, scan, topic="/front/points")
            scene.cloud(bag, stamp + 1, scan, topic="/back/points")
    done = cfodi("replay", tmp_path / "two")
    assert done.returncode == 2
    assert all(f"--topic {topic}" in done.stderr for topic in ("/front/points", "/back/points")), done.stderr


LISTED = ["--ros-args", "-p", "sensors:=[points]", "-p", "points.kind:=auto"]


@pytest.mark.parametrize("more", [[], ["-r", "points:=/nowhere/points", "-r", f"depth/image:={bags.IMAGE}"]],
                         ids=["as they are", "the second of two names"])
def test_defaults_that_are_given_in_words_change_nothing(more, images, tmp_path):
    """As `ros2 param dump` writes them."""
    for number, arguments in enumerate([LISTED, ["--ros-args"]]):
        output = tmp_path / str(number)
        done = cfodi("replay", images, "--voxels", output, *arguments, *more)
        assert done.returncode == 0 and f"reading {bags.IMAGE}" in done.stderr, done.stderr
    assert (tmp_path / "0").read_bytes() == (tmp_path / "1").read_bytes()


@pytest.mark.parametrize("rules, said", [
    ({"a": bags.POINTS, "b": bags.POINTS}, f"the sensors a and b are both read from {bags.POINTS}"),
    ({"a": bags.IMAGE, "b": bags.POINTS}, f"the sensor a is of kind cloud, and {bags.IMAGE} carries depth (-p a.kind:=depth)")])
def test_listed_sensors_that_the_node_would_refuse_or_never_hear_are_refused(rules, said, tmp_path):
    def both(bag, stamp, scan):
        scene.cloud(bag, stamp, scan)
        scene.image(bag, stamp, scan)
    folder = scene.write(tmp_path / "both", both)
    remaps = [word for name, topic in rules.items() for word in ("-r", f"{name}:={topic}")]
    done = cfodi("replay", folder, "--ros-args", "-p", "sensors:=[a, b]", *remaps)
    assert done.returncode == 2 and said in done.stderr, done.stderr


def test_without_odom_the_root_is_the_fixed_frame_and_is_named(clouds, tmp_path):
    run = Replay(clouds, tmp_path / "fallen", parameters=PAPER)
    named = Replay(clouds, tmp_path / "named", parameters=PAPER | {"fixed_frame": "map"})
    assert "map" in run.stderr and "odom" in run.stderr and "odom" not in named.stderr
    same_map(run, named)


def test_with_odom_the_fixed_frame_is_odom_and_not_the_root(tmp_path):
    with Bag(tmp_path / "bag") as bag:
        bag.static(scene.START - 1)
        bag.static(scene.START - 1, parent="map", child="odom", rotation=(0, 0, 0.6, 0.8))
        scene.moves(bag, parent="odom")
        for scan, stamp in enumerate(scene.stamps()):
            scene.cloud(bag, stamp, scan)
    run = Replay(tmp_path / "bag", tmp_path / "odom", parameters=PAPER)
    assert run.summary()["parameters"]["fixed_frame"] == "odom"
    in_map = Replay(tmp_path / "bag", tmp_path / "map", parameters=PAPER | {"fixed_frame": "map"})
    recount.assert_same_voxels(in_map.voxels(), recount.Voxels(tmp_path / "bag", bags.POINTS))
    assert set(run.voxels()) != set(in_map.voxels())


def test_a_fixed_frame_that_is_not_there_skips_every_scan_and_says_why(clouds, tmp_path):
    run = Replay(clouds, tmp_path, parameters=PAPER | {"fixed_frame": "nowhere"}, outputs=("summary", "voxels"))
    summary = run.summary()
    assert "nowhere" in run.stderr
    assert sum(summary["scans_skipped"].values()) == scene.SCANS and summary["scans"] == 0
    assert summary["dense_voxels"] == 0 and run.voxels() == {}


def test_a_bag_without_a_sensor_is_answered_with_what_it_holds(tmp_path):
    with Bag(tmp_path / "bag") as bag:
        bag.static(scene.START - 1)
        scene.moves(bag)
    done = cfodi("replay", tmp_path / "bag")
    assert done.returncode in (1, 2) and "/tf" in done.stderr and "panicked" not in done.stderr
