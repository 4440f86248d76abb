"""The node beside a real peer on CycloneDDS: the same topics, and services by that middleware's own way of calling."""

import time

import clouds
import depth_images
import numpy as np
import pytest
from cfodi_msgs.msg import SurfaceCluster, SurfaceClusterArray
from cfodi_node import accounted
from cyclone_peer import Robot
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

CLOUDS, IMAGES, INFO = "/camera/depth/points", "/camera/depth/image_raw", "/camera/depth/camera_info"
CYCLONE = {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}


@pytest.fixture
def robot(own_network):
    robot = Robot()
    yield robot
    robot.close()


def has_the_wall(snapshot):
    walls = [cluster for cluster in snapshot.clusters if cluster.surface_class == SurfaceCluster.CLASS_WALL]
    return any(abs(wall.centroid.x - 2.04) < 0.01 and abs(wall.area - 1) < 0.1 for wall in walls)


def assert_taken_in(counts, sent):
    """Each is accounted for; a busy machine may lose one."""
    assert accounted(counts) == sent and counts["taken_in"] >= sent - 1, counts


@pytest.mark.parametrize("reliable", [False, True])
def test_its_clouds_become_a_map_that_it_reads(reliable, start, robot):
    node = start().ready()
    robot.publisher(CLOUDS, PointCloud2, reliable=reliable)
    robot.meet()
    robot.drive(CLOUDS, PointCloud2, clouds.cloud(clouds.wall()))
    robot.read("/cfodi/clusters", SurfaceClusterArray, depth=1, latched=True).wait("a map with the wall", has_the_wall)
    robot.read("/cfodi/markers", MarkerArray, depth=1, latched=True).wait("markers", lambda array: array.markers)
    labelled = robot.read("/cfodi/points_labelled", PointCloud2, reliable=False)
    robot.drive(CLOUDS, PointCloud2, clouds.cloud(clouds.wall()), count=5)
    labelled.wait("labelled points", lambda cloud: cloud.width * cloud.height > 100)
    numbers = [delta.sequence for delta in robot.deltas.all()]
    counts = node.stop()
    assert_taken_in(counts, robot.sent)
    assert numbers == list(range(1, counts["taken_in"] + 1))


def test_its_clouds_of_megabytes_come_whole(large_buffers, start, robot):
    """Two a second, for CycloneDDS writes them byte by byte where the program is in Python."""
    node = start().ready()
    robot.publisher(CLOUDS, PointCloud2, reliable=False)
    robot.meet()
    snapshots = robot.read("/cfodi/clusters", SurfaceClusterArray, depth=1, latched=True)
    distant = np.zeros((480, 640, 8), np.float32)
    distant[..., :2], distant[..., 2] = np.moveaxis(np.indices((480, 640)), 0, -1)[..., ::-1] / 300 - (1.0, 0.8), 2.04
    robot.drive(CLOUDS, PointCloud2, clouds.cloud(distant), count=6)
    snapshots.wait("a map with the wall", lambda snapshot: any(cluster.area > 2 for cluster in snapshot.clusters))
    assert_taken_in(node.stop(), robot.sent)


def test_its_depth_images_become_a_map(start, robot):
    node = start(remaps={"depth/image": IMAGES, "depth/camera_info": INFO}, points=None).ready()
    robot.publisher(IMAGES, Image, reliable=False)
    robot.publisher(INFO, CameraInfo)
    robot.meet()
    snapshots = robot.read("/cfodi/clusters", SurfaceClusterArray, depth=1, latched=True)
    for _ in range(20):
        robot.publish(INFO, CameraInfo, clouds.stamped(depth_images.wall_info(), clouds.CLOUD_STAMP, time.time_ns()))
        robot.drive(IMAGES, Image, depth_images.image(depth_images.wall()), count=1)
    snapshots.wait("a map with a cluster", lambda snapshot: snapshot.clusters)
    assert_taken_in(node.stop(), robot.sent)


def test_its_calls_are_answered_where_the_node_is_told_of_it(start, robot):
    node = start(environment=CYCLONE).ready()
    robot.publisher(CLOUDS, PointCloud2, reliable=False)
    robot.meet()
    robot.drive(CLOUDS, PointCloud2, clouds.cloud(clouds.wall()))
    answer = robot.call("/cfodi/reset", Trigger, Trigger.Request())
    assert answer.success, answer
    wanted = Parameter(name="max_range", value=ParameterValue(type=3, double_value=5.0))
    [result] = robot.call("/cfodi/set_parameters", SetParameters, SetParameters.Request(parameters=[wanted])).results
    assert result.successful, result
    [value] = robot.call("/cfodi/get_parameters", GetParameters, GetParameters.Request(names=["max_range"])).values
    assert value.double_value == 5.0
    node.stop()


def test_a_node_that_comes_again_is_met_again(start, robot):
    robot.publisher(CLOUDS, PointCloud2, reliable=False)
    snapshots = robot.read("/cfodi/clusters", SurfaceClusterArray, depth=1, latched=True)
    sessions = set()
    for _ in range(2):
        node = start().ready()
        robot.meet()
        robot.drive(CLOUDS, PointCloud2, clouds.cloud(clouds.wall()))
        found = snapshots.wait("a map of this session", lambda m: has_the_wall(m) and m.session_id not in sessions)
        sessions.add(found.session_id)
        node.stop()


def test_it_reads_the_diagnostics(start, robot):
    start().ready()
    statuses = robot.read("/diagnostics", DiagnosticArray)
    statuses.wait("a status of the node", lambda array: any("cfodi" in status.name for status in array.status))

