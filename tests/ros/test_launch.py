"""The launch files, against the program: what they start comes up as asked for and takes in what the driver sends."""

import math
import os
import pathlib
import subprocess
import time

import clouds
import compare
import depth_images
import numpy as np
import pytest
from cfodi_node import REPOSITORY, program
from launching import SCRIPTS, launched
from peer import Camera, DepthCamera, wait_until
from sensor_msgs.msg import PointCloud2
from test_introspection import node_names, parameters

NODE_ARGUMENTS = {"points", "image", "camera_info", "name", "namespace", "params_file", "fixed_frame", "use_sim_time", "rviz",
                  "log_level", "resume"}


def of(context, executable):
    return [process for process in context.processes if process.executable == executable]


@pytest.fixture
def run(start, tmp_path):
    """Runs the node that a launch file describes; the description and the node."""
    def run(file, **values):
        context = launched(file, tmp_path, **values)
        [node] = of(context, "cfodi")
        assert node.package == "cfodi" and node.command[:2] == ["run", "--ros-args"], node
        return context, start(fixed_frame=None, points=None, arguments=node.command[2:])

    return run


def taken_in(peer, send, attempts=10):
    """The delta of the first scan that is taken in. `send(stamp)` sends one; the node may not know a transform yet."""
    sent = set()
    for _ in range(attempts):
        sent.add(stamp := time.time_ns())
        send(stamp)
        end = time.monotonic() + 2
        while time.monotonic() < end:
            if found := [delta for delta in peer.deltas if compare.stamp(delta) in sent]:
                return found[0]
            time.sleep(0.02)
    raise AssertionError(f"none of {attempts} scans was taken in")


@pytest.mark.parametrize("file, more", [
    ("node.launch.py", {}), ("cloud.launch.py", {}), ("kinect_v1.launch.py", {}), ("replay.launch.py", {"bag": "b"})])
def test_every_launch_file_takes_the_usual_arguments_and_its_node_comes_up(file, more, run, peer, tmp_path):
    file_of_parameters = tmp_path / "params.yaml"
    file_of_parameters.write_text("/robot/surfaces:\n  ros__parameters:\n    voxel_size: 0.1\n    fixed_frame: odom\n")
    context, node = run(file, namespace="robot", name="surfaces", fixed_frame="1", use_sim_time="true", log_level="warn",
                        params_file=str(file_of_parameters), **more)
    assert NODE_ARGUMENTS <= context.declared.keys() and all(context.declared.values())
    wait_until("the node under its name", lambda: "/robot/surfaces" in node_names(peer))
    wanted = {"fixed_frame": "1", "use_sim_time": True, "voxel_size": 0.1}
    assert parameters(peer, wanted, "/robot/surfaces") == wanted
    assert not any(" INFO " in line for line in node.lines)


def test_what_is_not_given_is_as_params_file_says(run, peer, tmp_path):
    file = tmp_path / "params.yaml"
    file.write_text("/**:\n  ros__parameters:\n    fixed_frame: map\n    use_sim_time: true\n")
    _, node = run("cloud.launch.py", params_file=str(file))
    node.ready()
    wanted = {"fixed_frame": "map", "use_sim_time": True}
    assert parameters(peer, wanted) == wanted


def test_without_arguments_the_parameters_are_those_of_config_kinect(run):
    context, node = run("cloud.launch.py")
    command = of(context, "cfodi")[0].command
    file = pathlib.Path(command[command.index("--params-file") + 1])
    assert file == REPOSITORY / "config" / "kinect.yaml" and file.is_file() and command.count("--params-file") == 1
    node.ready()


def test_the_node_goes_on_with_its_map_where_it_is_told_to(tmp_path):
    for given, verb in [({}, ["run"]), ({"resume": "false"}, ["run"]), ({"resume": "true"}, ["run", "--resume"])]:
        [node] = of(launched("cloud.launch.py", tmp_path, **given), "cfodi")
        assert node.command[:node.command.index("--ros-args")] == verb


def test_clouds_of_a_driver_are_taken_in(run, peer):
    _, node = run("cloud.launch.py", points="/front/points", fixed_frame="map")
    node.ready()
    peer.record_node()
    camera = Camera(peer.node, "/front/points", PointCloud2)
    camera.meet()
    delta = taken_in(peer, lambda stamp: camera.publish(clouds.cloud(clouds.wall()), stamp, clouds.still_transform()))
    assert delta.header.frame_id == "map" and delta.clusters
    assert node.stop()["taken_in"] >= 1


def rotation(roll, pitch, yaw):
    """A quaternion x y z w, as tf2's setRPY makes it: about the fixed axes x, y, z, in this order."""
    turns = [np.eye(3)[axis] * math.sin(angle / 2) for axis, angle in enumerate((roll, pitch, yaw))]
    about_x, about_y, about_z = ((*turn, math.cos(angle / 2)) for turn, angle in zip(turns, (roll, pitch, yaw)))
    return clouds.quaternion_product(about_z, clouds.quaternion_product(about_y, about_x))


def static_transform(process):
    """The message that static_transform_publisher would latch."""
    words = process.command[:process.command.index("--ros-args")]
    value = dict(zip(words[::2], words[1::2], strict=True))
    place, angles = ([float(value.get(f"--{name}", 0)) for name in names]
                     for names in (("x", "y", "z"), ("roll", "pitch", "yaw")))
    return clouds.transform(value["--frame-id"], value["--child-frame-id"], place, rotation(*angles))


def test_depth_images_of_a_kinect_v1_are_taken_in_where_it_stands(run, peer):
    context, node = run("kinect_v1.launch.py", namespace="robot", fixed_frame="base_link", z="1.0", pitch="0.3")
    node.ready("/robot/cfodi")
    peer.record_node("/robot/cfodi")
    mount, optics = of(context, "static_transform_publisher")
    assert mount.package == optics.package == "tf2_ros"
    camera = DepthCamera(peer.node, "/robot/depth/image_raw", "/robot/depth/camera_info", depth_images.wall_info(), True)
    camera.meet()

    def send(stamp):
        for transform in (mount, optics):
            camera._tf.publish(clouds.stamped(static_transform(transform), clouds.TF_STAMP, stamp))
        camera.publish(depth_images.image(depth_images.wall(), "kinect_depth"), stamp)

    delta = taken_in(peer, send)
    wall = max(delta.clusters, key=lambda cluster: cluster.voxel_count)
    # It looks ahead and 0.3 rad down, at a wall square to that, 2.04 m off.
    normal = np.array(wall.plane.coef[:3])
    expected = np.array([-math.cos(0.3), 0.0, math.sin(0.3)])
    assert np.allclose(normal, expected, atol=2e-3), normal
    assert abs(wall.plane.coef[3] + expected @ (np.array([0.0, 0.0, 1.0]) - 2.04 * expected)) < 0.01, wall.plane
    assert node.stop()["taken_in"] >= 1


def test_the_kinects_transform_can_be_left_to_others(tmp_path):
    context = launched("kinect_v1.launch.py", tmp_path, transform="false")
    assert [process.executable for process in context.processes] == ["cfodi"]


def test_rviz_shows_the_topics_of_the_node(tmp_path):
    context = launched("cloud.launch.py", tmp_path, rviz="true", fixed_frame="map", namespace="robot", name="surfaces")
    [rviz] = of(context, "rviz2")
    assert rviz.package == "rviz2"
    assert rviz.command[:4] == ["-d", str(SCRIPTS / "cfodi.rviz"), "-f", "map"]
    assert "__ns:=/robot" in rviz.command and "/cfodi/markers:=surfaces/markers" in rviz.command
    assert not of(launched("cloud.launch.py", tmp_path), "rviz2")
    [rviz] = of(launched("cloud.launch.py", tmp_path, rviz="true"), "rviz2")
    assert "-f" not in rviz.command and "Fixed Frame: odom" in (SCRIPTS / "cfodi.rviz").read_text(), "as docs/install.md says"


def test_a_replay_plays_the_bag_on_its_own_time(tmp_path):
    context = launched("replay.launch.py", tmp_path, bag="recorded", points="/points", rate="0.5")
    [player], [rviz], [node] = (of(context, executable) for executable in ("ros2", "rviz2", "cfodi"))
    assert player.command == ["bag", "play", "recorded", "--clock", "--rate", "0.5", "--delay", "3.0"]
    for process in (rviz, node):
        files = [word for flag, word in zip(process.command, process.command[1:]) if flag == "--params-file"]
        assert "use_sim_time: true" in pathlib.Path(files[-1]).read_text()
    with pytest.raises(AssertionError, match="bag has no value"):
        launched("replay.launch.py", tmp_path)


@pytest.mark.parametrize("script, arguments, topics", [
    ("kinect.sh", ["/front/points"], ["/front/points"]),
    ("depth.sh", ["/front/image_raw"], ["/front/image_raw", "/front/camera_info"]),
    ("depth.sh", ["image_raw"], ["/image_raw", "/camera_info"]),
    ("kinect.sh", ["-r", "points:=/front/points"], ["/front/points"]),
    ("depth.sh", ["image_raw", "-r", "depth/image:=/front/image_raw", "-r", "depth/camera_info:=/front/info"],
     ["/front/image_raw", "/front/info"]),
])
def test_the_shell_scripts_start_the_node(script, arguments, topics, peer, tmp_path):
    (tmp_path / "cfodi").symlink_to(program())
    environment = {k: v for k, v in os.environ.items() if k not in ("LD_LIBRARY_PATH", "PYTHONPATH")}
    node = subprocess.Popen(["bash", SCRIPTS / script, *arguments, "-p", "voxel_size:=0.1"],
                            env=environment | {"PATH": f"{tmp_path}:{os.environ['PATH']}"})
    try:
        wait_until("its inputs", lambda: all(peer.node.count_subscribers(topic) for topic in topics))
        assert parameters(peer, ["voxel_size"]) == {"voxel_size": 0.1}
        node.terminate()
        assert node.wait() == 0
    finally:
        node.kill()
        node.wait()
