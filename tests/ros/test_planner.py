"""examples/planner.py: what it makes of a map, and a robot that it drives."""

import math
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

import clouds
import cpp
import depth_images
import numpy as np
import pytest
import scene
from cfodi_msgs.msg import SurfaceCluster, SurfaceClusterArray
from geometry_msgs.msg import Point, Point32, Polygon, Pose, Quaternion, Transform, TransformStamped, Twist, Vector3
from peer import qos, wait_until
from planner import LABELLED, PARAMETERS, Driver, Freshness, Planner, Standing, impossible
from sensor_msgs.msg import PointCloud2, PointField
from shape_msgs.msg import Plane
from tf2_msgs.msg import TFMessage

HERE = pathlib.Path(__file__).resolve().parent
BASE = (0.0, 0.0, 0.1, 0.0)  # a base frame 10 cm above the ground, looking along x
FLOOR, HORIZONTAL, WALL, SLOPE, CURVED = (SurfaceCluster.CLASS_FLOOR, SurfaceCluster.CLASS_HORIZONTAL, SurfaceCluster.CLASS_WALL,
                                          SurfaceCluster.CLASS_SLOPE, SurfaceCluster.CLASS_CURVED)
S = math.sqrt(0.5)


def surface(id, surface_class, corners, normal=(0.0, 0.0, 1.0), area=1.0, state=SurfaceCluster.STATE_ACTIVE, holes=()):
    """A cluster with this outline, its pose in the middle of the corners."""
    middle = [sum(c[i] for c in corners) / len(corners) for i in range(3)]
    offset = -sum(n * m for n, m in zip(normal, middle))
    x, y, z = middle
    return SurfaceCluster(
        id=id, surface_class=surface_class, class_confidence=0.9, state=state, area=area, plane=Plane(coef=[*normal, offset]),
        pose=Pose(position=Point(x=x, y=y, z=z)),
        boundary=ring(corners), holes=[ring(hole) for hole in holes])


def ring(corners):
    return Polygon(points=[Point32(x=float(x), y=float(y), z=float(z)) for x, y, z in corners])


def wall(*corners, holes=(), x=2.0):
    """Upright, across the robot's way; corners as y, z."""
    outlines = [[(x, y, z) for y, z in outline] for outline in (corners, *holes)]
    return surface(2, WALL, outlines[0], (-1.0, 0.0, 0.0), holes=outlines[1:])


def box(y, z):
    """The corners of a rectangle, as `wall` takes them."""
    return [(y[0], z[0]), (y[1], z[0]), (y[1], z[1]), (y[0], z[1])]


def level(id, surface_class, z, x, y, **more):
    return surface(id, surface_class, [(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)], **more)


def tilted(id, surface_class, tilt, x, **more):
    """2 m wide, of a normal in the plane of x and z; it is at z = 0 where it begins, and rises from there."""
    rise = math.tan(tilt) * (x[1] - x[0])
    corners = [(x[0], -1.0, 0.0), (x[1], -1.0, rise), (x[1], 1.0, rise), (x[0], 1.0, 0.0)]
    return surface(id, surface_class, corners, (-math.sin(tilt), 0.0, math.cos(tilt)), **more)


def planner(*clusters):
    ground = level(1, FLOOR, 0.0, (-5.0, 5.0), (-5.0, 5.0), area=100.0)
    return seen(ground, *clusters), ground


def seen(*clusters):
    known = Planner(width=0.5, height=1.2)
    known.map.snapshot(SurfaceClusterArray(session_id=1, sequence=1, clusters=clusters))
    return known


def free(*clusters, robot=BASE):
    known, ground = planner(*clusters)
    return known.free_ahead(ground, robot)


def test_outlines_within_the_robots_width_and_height_are_in_its_way_and_others_are_not():
    across = wall(*box((-3.0, 3.0), (0.0, 2.5)))
    assert free(across) == pytest.approx(2.0)
    assert free(across, robot=(1.0, 1.0, 0.1, 0.0)) == pytest.approx(1.0)
    assert free(across, robot=(0.0, 0.0, 0.1, math.pi)) == math.inf, "it is behind"
    assert free(level(3, HORIZONTAL, 0.7, (1.0, 1.8), (-0.2, 0.6))) == pytest.approx(1.0)
    assert free(level(3, HORIZONTAL, 0.7, (1.0, 1.8), (0.3, 0.6))) == math.inf, "it stands beside the robot's way"
    assert free(level(3, HORIZONTAL, 1.3, (1.0, 1.8), (-0.2, 0.6))) == math.inf, "the robot goes under it"
    assert free(level(3, HORIZONTAL, 0.05, (1.0, 1.8), (-0.2, 0.6))) == math.inf, "it is the noise of the ground"


def test_of_a_surface_that_has_changed_the_new_outline_is_in_its_way_and_of_one_that_is_gone_nothing_is_kept():
    known, ground = planner(level(3, HORIZONTAL, 0.7, (1.0, 1.8), (-0.2, 0.6)))
    assert [known.free_ahead(ground, BASE) for _ in range(2)] == pytest.approx([1.0, 1.0])
    known.map.snapshot(SurfaceClusterArray(session_id=1, sequence=2, clusters=[ground, level(3, HORIZONTAL, 0.7, (1.5, 1.8), (-0.2, 0.6))]))
    assert known.free_ahead(ground, BASE) == pytest.approx(1.5)
    known.map.snapshot(SurfaceClusterArray(session_id=1, sequence=3, clusters=[ground]))
    assert known.free_ahead(ground, BASE) == math.inf and 3 not in known.outlines


def test_a_surface_is_in_its_way_where_its_outline_is_beside_above_and_below():
    assert free(wall(*box((-3.0, 3.0), (-0.5, 2.5)))) == pytest.approx(2.0)
    top = level(3, HORIZONTAL, 0.7, (1.0, 2.0), (-1.5, 1.5))
    assert free(top) == pytest.approx(1.0)
    assert free(top, robot=(1.5, 0.0, 0.1, 0.0)) == 0.0, "it is within it"
    slanting = surface(2, WALL, [(0.0, -2.0, 0.0), (4.0, 2.0, 0.0), (4.0, 2.0, 2.5), (0.0, -2.0, 2.5)], (-S, S, 0.0))
    assert free(slanting) == pytest.approx(1.75), "where it comes into the lane"
    ramp = surface(3, SLOPE, [(1.0, -2.0, 0.0), (3.0, -2.0, 2.0), (3.0, 2.0, 2.0), (1.0, 2.0, 0.0)], (-S, 0.0, S))
    assert free(ramp) == pytest.approx(1.15), "where it is no noise of the ground any more"
    stairs_from_below = surface(3, SLOPE, [(1.0, -2.0, 2.0), (3.0, -2.0, 0.0), (3.0, 2.0, 0.0), (1.0, 2.0, 2.0)], (S, 0.0, S))
    assert free(stairs_from_below) == pytest.approx(1.8), "where it is as low as the robot is high"


def test_an_open_door_is_free_where_the_robot_fits_through_it():
    def doorway(side, height):
        return wall((-3, 0), (-side, 0), (-side, height), (side, height), (side, 0), (3, 0), (3, 2.5), (-3, 2.5))

    assert free(doorway(0.5, 2.0)) == math.inf
    assert free(doorway(0.26, 2.0)) == math.inf
    assert free(doorway(0.24, 2.0)) == pytest.approx(2.0), "it is narrower than the robot"
    assert free(doorway(0.1, 2.0)) == pytest.approx(2.0)
    assert free(doorway(0.5, 1.1)) == pytest.approx(2.0), "its lintel is lower than the robot"
    assert free(doorway(0.5, 2.0), robot=(0.0, 0.3, 0.1, 0.0)) == pytest.approx(2.0), "the robot would meet its side"
    assert free(doorway(0.5, 2.0), robot=(0.0, 2.0, 0.1, 0.0)) == pytest.approx(2.0), "the robot is before the wall beside it"
    assert free(wall(*box((-0.5, 0.5), (2.0, 2.5)))) == math.inf, "a lintel alone"
    assert free(wall(*box((-0.5, 0.5), (1.1, 2.5)))) == pytest.approx(2.0), "a low one"


def test_a_hole_of_an_outline_is_a_way_from_the_floor_up_and_a_window_is_none():
    def opening(side, bottom, top):
        return wall(*box((-3.0, 3.0), (0.0, 2.5)), holes=[box((-side, side), (bottom, top))[::-1]])

    assert free(opening(0.5, 0.0, 2.0)) == math.inf
    assert free(opening(0.5, 0.08, 2.0)) == math.inf, "a voxel above the ground"
    assert free(opening(0.2, 0.08, 2.0)) == pytest.approx(2.0), "it is narrower than the robot"
    assert free(opening(0.5, 0.9, 2.0)) == pytest.approx(2.0), "the wall below the window"
    assert free(opening(1.5, 0.9, 2.0)) == pytest.approx(2.0), "wider than the robot's way"
    assert free(opening(1.5, 0.08, 1.0)) == pytest.approx(2.0), "the wall above a hatch"


def test_nothing_of_a_surface_is_nearer_than_is_told_and_something_is_there():
    rng, step = np.random.default_rng(7), 0.02
    told = []
    for _ in range(150):
        axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        turns = np.sort(rng.uniform(0.0, 2 * math.pi, 9))
        flat = (rng.uniform(0.2, 1.6, 9) * [np.cos(turns), np.sin(turns)]).T
        place = rng.uniform([-0.5, -1.0, -0.5], [3.0, 1.0, 1.5])
        crooked = surface(2, WALL, place + flat @ axes[:2], axes[2])
        points = place + samples(flat, step) @ axes[:2]
        told.append(free(crooked, robot=(0.0, 0.0, 0.0, 0.0)))
        assert told[-1] <= nearest(points, -1e-5) + 1e-5
        assert told[-1] >= nearest(points, 2 * step) - 2 * step
    assert 50 < np.isfinite(told).sum() < 150


def samples(corners, step):
    """Points all over a polygon and its sides, seen flat."""
    following = np.roll(corners, -1, axis=0)
    sides = [a + np.arange(0.0, 1.0, step / 2)[:, None] * (b - a) for a, b in zip(corners, following)]
    grid = np.stack(np.meshgrid(*[np.arange(-1.7, 1.7, step)] * 2), axis=-1).reshape(-1, 2)
    within = np.zeros(len(grid), bool)
    for a, b in zip(corners, following):
        crosses = (a[1] > grid[:, 1]) != (b[1] > grid[:, 1])
        within ^= crosses & (grid[:, 0] < a[0] + (grid[:, 1] - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
    return np.concatenate([grid[within], *sides])


def nearest(points, margin):
    """How far ahead the nearest of them is in a lane that is wider on all sides by a margin."""
    ahead, left, height = points.T
    there = (ahead > -margin) & (abs(left) < 0.25 + margin) & (0.15 - margin < height) & (height < 1.2 + margin)
    return max(ahead[there].min(initial=math.inf), 0.0)


def test_voxels_above_the_ground_are_in_its_way_too_whatever_their_cluster():
    known, ground = planner(level(2, HORIZONTAL, 0.7, (2.0, 2.8), (-0.2, 0.6)))
    known.points(clouds_of([(1.5, 0.1, 0.4, 0), (0.7, 0.0, 0.1, 1), (0.5, 0.4, 0.3, 0), (1.2, 0.0, 1.5, 0)]))
    assert known.free_ahead(ground, BASE) == pytest.approx(1.5), "what is low is ground"
    known.points(clouds_of([(1.5, 0.1, 0.4, 0), (0.6, 0.0, 0.3, 1)]))
    assert known.free_ahead(ground, BASE) == pytest.approx(0.6), "of the ground's cluster, as a ramp is before it is one of its own"
    known.points(clouds_of([(0.8, 0.0, 0.3, 77)]))
    assert known.free_ahead(ground, BASE) == pytest.approx(0.8), "of a cluster without an outline"
    known.points(clouds_of([(1.0, 0.0, 0.7, 2)]))
    assert known.free_ahead(ground, BASE) == pytest.approx(1.0), "of a cluster whose outline is that of another part"


def clouds_of(points):
    """As ~/points_labelled, of x, y, z, label."""
    data = np.array(points, dtype=[("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("label", "<u4")])
    fields = [PointField(name=n, offset=4 * i, datatype=6 if n == "label" else 7, count=1) for i, n in enumerate(data.dtype.names)]
    return PointCloud2(height=1, width=len(points), fields=fields, point_step=16, row_step=16 * len(points), data=data.tobytes())


def test_the_ground_is_what_the_robot_stands_on_and_the_table_is_the_nearest_to_the_wished_height():
    lower = level(2, FLOOR, -0.8, (-9.0, 9.0), (-9.0, 9.0), area=300.0)
    shelf, desk = (level(id, HORIZONTAL, z, (1.0, 2.0), (0.0, 1.0)) for id, z in ((3, 1.1), (4, 0.7)))
    new = level(5, HORIZONTAL, 0.76, (1.0, 2.0), (0.0, 1.0), state=SurfaceCluster.STATE_TENTATIVE)
    known, ground = planner(lower, shelf, desk, new)
    assert known.ground(BASE).id == 1
    assert known.ground((0.0, 0.0, 5.0, 0.0)) is None
    assert [known.table(ground, height)[1].id for height in (0.75, 1.0)] == [4, 3]
    assert known.table(ground, 0.75)[0] == pytest.approx(0.7)
    assert planner()[0].table(ground, 0.75) is None


def flight(first, up):
    """Four steps with this height of the first, 2 m ahead; with as large an area as a floor that is hardly seen yet."""
    return [level(10 + n, HORIZONTAL, first + up * 0.17 * n, (2.0 + 0.28 * n, 2.28 + 0.28 * n), (-1.0, 1.0), area=0.6) for n in range(4)]


def test_a_step_ahead_is_not_the_ground_and_is_in_the_way():
    floor = level(1, FLOOR, 0.0, (1.3, 2.0), (-0.5, 0.5), area=0.5)
    known = seen(floor, *flight(0.17, up=1))
    assert known.ground(BASE).id == 1, "though it is not over it yet, for a Kinect does not see the floor before its wheels"
    assert known.free_ahead(floor, BASE) == pytest.approx(2.0)
    assert known.ground((1.5, 0.0, 0.1, 0.0)).id == 1
    assert seen(*flight(0.17, up=1)).ground(BASE) is None, "before it has seen the floor"


def test_on_a_landing_it_stands_on_the_landing():
    landing = level(1, FLOOR, 1.0, (-1.0, 2.0), (-1.0, 1.0), area=0.5)
    lower = level(2, FLOOR, 0.0, (-5.0, 9.0), (-5.0, 5.0), area=100.0)
    known = seen(lower, landing, *flight(0.83, up=-1))
    for robot in [(0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 1.1, 0.0), (1.9, 0.0, 1.1, 0.0), (-1.2, 0.0, 1.1, 0.0)]:
        assert known.ground(robot).id == 1
    platform = level(3, HORIZONTAL, 0.17, (-1.0, 1.0), (-1.0, 1.0))
    assert seen(lower, platform).ground((0.0, 0.0, 0.27, 0.0)).id == 3, "the higher of two that it is over"
    assert seen(lower, platform).ground((-2.0, 0.0, 0.0, 0.0)).id == 2


def test_the_ground_may_begin_ahead_by_what_a_camera_does_not_see_of_it():
    assert seen(level(1, FLOOR, 0.0, (2.4, 4.0), (-1.0, 1.0))).ground(BASE).id == 1
    assert seen(level(1, FLOOR, 0.0, (2.6, 4.0), (-1.0, 1.0))).ground(BASE) is None
    assert seen(level(1, FLOOR, 0.0, (1.0, 4.0), (0.5, 1.0))).ground(BASE) is None, "beside its way"
    turned = level(1, FLOOR, 0.0, (-4.0, 4.0), (-4.0, 4.0))
    turned.holes = [ring([(1.3, 1.3, 0.0), (1.3, -1.3, 0.0), (-1.3, -1.3, 0.0), (-1.3, 1.3, 0.0)])]
    assert seen(turned).ground(BASE).id == 1, "not seen where it turned on the spot"
    new = level(2, HORIZONTAL, 0.05, (-1.0, 1.0), (-1.0, 1.0), state=SurfaceCluster.STATE_TENTATIVE)
    assert seen(new, turned).ground(BASE).id == 1, "the one that can be relied on"
    assert seen(new).ground(BASE).id == 2, "there is no other"


def test_a_floor_that_is_one_with_a_ramp_makes_the_robot_stand_though_the_ramps_foot_is_called_level():
    curved, foot = level(1, CURVED, 0.0, (-3.0, 4.0), (-2.0, 2.0)), tilted(2, HORIZONTAL, 0.04, (2.2, 3.2))
    known = seen(curved, foot)
    assert seen(foot).ground(BASE).id == 2, "its tilt is small enough for a floor"
    assert known.ground(BASE) is None, "but something else is under the wheels"
    assert known.ground((2.5, 0.0, 0.1, 0.0)).id == 2, "on it, it is what the robot stands on"
    ahead = level(1, CURVED, 0.0, (1.3, 4.0), (-2.0, 2.0))
    assert seen(ahead, foot).ground(BASE) is None, "or comes first, where it has not been seen below the robot"
    best_fit = level(1, CURVED, 0.25, (-3.0, 4.0), (-2.0, 2.0))
    assert seen(best_fit, foot).ground(BASE) is None, "its plane is a best fit only, and too high here"
    assert seen(curved, level(3, FLOOR, 0.0, (-1.0, 4.0), (-2.0, 2.0))).ground(BASE).id == 3, "of two below it a level one"
    ramp, high = tilted(1, SLOPE, 0.3, (1.3, 3.0)), level(1, CURVED, 0.5, (-3.0, 4.0), (-2.0, 2.0))
    for other in (ramp, high, wall(*box((-1.0, 1.0), (0.0, 2.0)), x=1.0)):
        assert seen(other, level(3, FLOOR, 0.0, (2.0, 4.0), (-1.0, 1.0))).ground(BASE).id == 3, "the other is not at its height"


def test_the_ground_and_the_table_are_known_to_be_level():
    floor, table = level(1, FLOOR, 0.0, (-1.0, 4.0), (-1.0, 1.0)), level(2, HORIZONTAL, 0.7, (1.0, 2.0), (-0.5, 0.5))

    def found(**more):
        """Whether both are, with other values in their messages."""
        messages = []
        for each in (floor, table):
            messages.append(SurfaceCluster(**{name: getattr(each, name) for name in each.get_fields_and_field_types()}))
            for name, value in more.items():
                setattr(messages[-1], name, value)
        ground, on = seen(messages[0]).ground(BASE), seen(messages[1]).table(floor, 0.75)
        assert (ground is None) == (on is None)
        return ground is not None

    def turns(first, second):
        return [first, 0.0, 0.0, 0.0, second, 0.0, 0.0, 0.0, 1e-6]

    assert found()
    assert found(class_confidence=0.5), "of floor and raised a half each"
    assert not found(class_confidence=0.2)
    assert found(plane_covariance=turns(0.04**2, 0.04**2))
    assert not found(plane_covariance=turns(0.06**2, 0.0))
    assert not found(plane_covariance=turns(0.0, 0.06**2))
    assert not found(plane_covariance=[math.nan] * 9)
    assert seen(tilted(1, FLOOR, 0.04, (0.0, 4.0))).ground(BASE).id == 1
    assert seen(tilted(1, FLOOR, 0.06, (0.0, 4.0))).ground(BASE) is None
    assert seen(tilted(2, HORIZONTAL, 0.06, (1.0, 3.0))).table(floor, 0.75) is None


STAMPS = [99.5, 99.8, 99.9]  # of map, voxels and pose


def lack(freshness, stamps, now, steady):
    """Why they are not of now: a reason and its numbers, or None."""
    return freshness.lacks(dict(zip(("map", LABELLED, "pose"), stamps)), now, steady)


@pytest.mark.parametrize("stamps, now, reason, numbers", [
    (STAMPS, 100.0, None, None),
    (STAMPS, 100.75, "the map is too old", "1.25 s, max_age is 1 s; cfodi is not heard, or takes in no scan"),
    ([100.5, 98.5, 100.9], 101.0, "the cloud of labelled points is too old", "net.core.rmem_default"),
    (STAMPS, 99.75, None, None),  # the clock of the pose is a little ahead
    (STAMPS, 99.65, "the pose is ahead of the clock", "by 0.25 s"),
    ([130.0, 130.0, 99.9], 100.0, "the map is ahead of the clock", "by 30 s"),  # though the camera may have died since
    ([99.5, 0.0, 99.9], 100.0, "no cloud of labelled points has come", "net.core.rmem_default"),
    ([0.0, 0.0, 0.0], 0.0, "no time has come on /clock", "use_sim_time"),
    ([0.1, 0.1, 0.1], 0.0, "no time has come on /clock", "use_sim_time"),
    ([0.1, 0.0, 0.1], 0.5, "no cloud of labelled points has come", "net.core.rmem_default"),
])
def test_what_is_seen_is_of_now_where_all_stamps_are_near_the_clock(stamps, now, reason, numbers):
    found = lack(Freshness(1.0), stamps, now, 7.0)
    assert found is None if reason is None else found[0] == reason and numbers in found[1]
    assert found is None or is_explained(found)


def test_of_what_comes_with_stamps_behind_the_clock_that_is_said():
    freshness = Freshness(1.0)
    steps = ((98.0, 7.0), (98.5, 7.25), (98.5, 8.5))  # the others come each time
    said = [lack(freshness, [99.0 + steady / 8, stamp, 99.0 + steady / 8], 100.5, steady)[1] for stamp, steady in steps]
    behind = "2 s, max_age is 1 s; it comes, and its stamps are behind the clock"
    assert "rmem_default" in said[0] and said[1] == behind and "rmem_default" in said[2], said


def is_explained(why):
    """Whether docs/trouble.md has a line about it."""
    page = (cpp.EXAMPLES.parent / "docs" / "trouble.md").read_text()
    rows = page.split("\n## A planner that stands\n")[1].split("\n## ")[0]
    cells = re.findall(r"^\| (`.*?`) \| ", rows, re.MULTILINE)
    quoted = [one or other for cell in cells for one, other in re.findall(r"``(.+?)``|`([^`]+)`", cell)]
    assert len(quoted) > 8
    return any(re.search(".+".join(map(re.escape, words.split("..."))), why[0]) for words in quoted)


def test_what_does_not_come_again_grows_old_though_the_clock_is_set_or_stands_still():
    freshness = Freshness(1.0)
    assert not lack(freshness, STAMPS, 100.0, 7.0)
    assert not lack(freshness, STAMPS, 100.0, 7.9)
    reason, numbers = lack(freshness, STAMPS, 100.0, 8.125)
    assert reason == "no new map comes" and numbers.startswith("for 1.125 s, max_age is 1 s"), "the clock stands still"
    assert is_explained((reason, numbers))
    assert not lack(freshness, [100.5, 100.8, 100.9], 101.0, 8.2)
    assert lack(freshness, [100.5, 100.8, 100.6], 100.7, 9.3), "the clock was set back, and the pose alone is new"
    assert not lack(freshness, [100.6, 100.6, 100.6], 100.7, 9.4)


@pytest.mark.parametrize("given, why", [
    ({}, None),
    ({"speed": 0.0, "stop_before": 0.0, "wished_height": 0.0}, None),
    ({"stop_before": 4.0}, "slow_from is 1.5 and stop_before is 4; slow_from must be more"),
    ({"stop_before": 1.5}, "slow_from is 1.5 and stop_before is 1.5; slow_from must be more"),
    ({"speed": -0.3}, "speed is -0.3; it must be a finite number and not below 0"),
    ({"slow_from": math.inf}, "slow_from is inf; it must be a finite number and not below 0"),
    ({"wished_height": math.nan}, "wished_height is nan; it must be a finite number and not below 0"),
    ({"width": 0.0}, "width is 0; it must be more than 0"),
    ({"height": 0.15}, "height is 0.15; it must be more than 0.15"),  # nothing would be in its way
    ({"max_age": 0.0}, "max_age is 0; it must be more than 0"),
])
def test_parameters_by_which_nobody_can_drive_are_refused_with_their_numbers(given, why):
    given = PARAMETERS | given
    if why is None:
        assert impossible(given) is None
        return
    assert impossible(given).startswith(why)
    with pytest.raises(ValueError, match=re.escape(why)):
        Driver(given)


@pytest.mark.parametrize("stop_before", [0.0, 0.5, 1.4999])
def test_it_is_never_faster_nearer_to_an_obstacle(stop_before):
    driver = Driver(PARAMETERS | {"stop_before": stop_before})
    distances = np.arange(0.0, 5.0, 0.01)
    speeds, whys = zip(*map(driver.before, distances))
    assert (np.diff(speeds) >= 0.0).all() and speeds[-1] == PARAMETERS["speed"]
    assert [speed == 0.0 for speed in speeds] == [free <= stop_before for free in distances]
    assert [why is not None for why in whys] == [speed == 0.0 for speed in speeds]
    assert driver.before(math.inf) == (PARAMETERS["speed"], None)


class Seeing:
    """A driver to whom all of this has come, with stamps of 100 s."""

    def __init__(self, **parameters):
        self.driver, self.sequence = Driver(PARAMETERS | parameters), 0

    def sees(self, *clusters, session_id=1):
        self.sequence += 1
        map = SurfaceClusterArray(session_id=session_id, sequence=self.sequence, clusters=clusters)
        self.driver.planner.map.snapshot(of_now(map))

    def stands(self, z=0.1, now=100.0):
        """Why, where its base frame is so high."""
        self.driver.transforms(TFMessage(transforms=[of_now(TransformStamped(
            child_frame_id="base_link", transform=Transform(translation=Vector3(z=z), rotation=Quaternion(w=1.0))))]))
        why = self.driver.speed(now, 7.0)[1]
        assert why is None or is_explained(why)
        return why


def of_now(message):
    message.header.frame_id, message.header.stamp.sec = "odom", 100
    return message


def test_what_does_not_belong_together_is_not_driven_by():
    seeing, floor = Seeing(), level(1, FLOOR, 0.0, (-5.0, 5.0), (-5.0, 5.0))
    seeing.sees(floor)
    elsewhere = of_now(clouds_of([]))
    elsewhere.header.frame_id = "map"
    seeing.driver.planner.points(elsewhere)
    assert seeing.stands()[0] == "map and labelled points are in different frames"
    seeing.driver.planner.points(of_now(clouds_of([])))
    assert seeing.stands() is None
    seeing.sees(floor, session_id=2)
    assert seeing.stands()[0] == "a new session has begun, which may know nothing of what was seen before"
    seeing.sees(floor, session_id=1)
    assert seeing.stands() is None


@pytest.mark.parametrize("translation, rotation", [
    (Vector3(x=math.nan), Quaternion(w=1.0)), (Vector3(z=math.inf), Quaternion(w=1.0)), (Vector3(), Quaternion(w=math.nan)),
    (Vector3(), Quaternion(w=0.0)), (Vector3(), Quaternion(w=1.02))], ids=["x", "z", "rotation", "none", "long"])
def test_it_stands_where_its_transform_is_no_place(translation, rotation):
    seeing = Seeing()
    seeing.sees(level(1, FLOOR, 0.0, (-5.0, 5.0), (-5.0, 5.0)))
    seeing.driver.planner.points(of_now(clouds_of([])))
    assert seeing.stands() is None
    lost = Transform(translation=translation, rotation=rotation)
    seeing.driver.transforms(TFMessage(transforms=[of_now(TransformStamped(child_frame_id="base_link", transform=lost))]))
    speed, why = seeing.driver.speed(100.0, 7.0)
    assert (speed, why[0]) == (0.0, "the robot's transform is no place") and is_explained(why)


def test_names_of_frames_may_have_the_slash_of_ros_1():
    seeing = Seeing(base_frame="/kinect")
    seeing.sees(level(1, FLOOR, 0.0, (-5.0, 5.0), (-5.0, 5.0)))
    seeing.driver.planner.points(of_now(clouds_of([])))
    pose = of_now(TransformStamped(child_frame_id="/kinect", transform=Transform(translation=Vector3(z=0.1), rotation=Quaternion(w=1.0))))
    pose.header.frame_id = "/odom"
    seeing.driver.transforms(TFMessage(transforms=[pose]))
    assert seeing.driver.speed(100.0, 7.0)[1] is None


def test_it_knows_why_it_stands():
    seeing, floor = Seeing(), level(1, FLOOR, 0.0, (-5.0, 5.0), (-5.0, 5.0))
    driver = seeing.driver
    assert driver.speed(100.0, 7.0) == (0.0, ("no map has come", "cfodi is not heard, or takes in no scan"))
    seeing.sees(floor)
    assert driver.speed(100.0, 7.0)[1][0] == "no cloud of labelled points has come"
    driver.planner.points(of_now(clouds_of([])))
    why = driver.speed(100.0, 7.0)[1]
    assert why[0] == "no transform from `odom` straight to `base_link` has come" and is_explained(why)
    assert seeing.stands() is None
    assert seeing.stands(now=101.5)[0] == "the map is too old"
    assert seeing.stands(z=3.0) == ("no floor is seen below the robot or up to 2.5 m ahead", "its base frame is at (0, 0, 3)")
    seeing.sees(level(1, CURVED, 0.0, (-5.0, 5.0), (-5.0, 5.0)))
    assert seeing.stands() == ("what is below the robot or first ahead is not known to be level",
                               "cluster 1: class 6, confidence 0.9, rises by 0 m/m, which is known to 0")
    seeing.sees(floor, wall(*box((-3.0, 3.0), (0.0, 2.0)), x=0.25))
    assert seeing.stands() == ("an obstacle is ahead", "0.25 m from the base frame, stop_before is 0.5 m")
    seeing = Seeing(speed=0.0)
    seeing.sees(floor)
    seeing.driver.planner.points(of_now(clouds_of([])))
    assert seeing.stands() == ("the parameter speed is 0", "")


def test_it_says_why_it_stands_where_that_is_new_and_every_5_s():
    standing, map = Standing(), ("no map has come", "")
    near, nearer = (("an obstacle is ahead", f"{away} m") for away in (0.3, 0.2))
    assert standing.line(map, 1.0) == "the robot stands: no map has come"
    assert standing.line(map, 1.1) is None and standing.line(map, 5.9) is None
    assert standing.line(map, 6.0) == "the robot stands: no map has come"
    assert standing.line(near, 6.1) is None, "two reasons in turn do not fill the log"
    assert standing.line(near, 7.0) == "the robot stands: an obstacle is ahead (0.3 m)"
    assert standing.line(nearer, 8.5) is None, "other numbers are no other reason"
    assert standing.line(None, 9.0) is None
    assert standing.line(nearer, 9.1) == "the robot stands: an obstacle is ahead (0.2 m)", "it has driven since"


def test_the_planner_in_cpp_compiles_against_the_generated_headers_and_does_the_same(tmp_path):
    cpp.run(HERE / "planner_test.cpp", tmp_path)


def test_the_node_in_cpp_does_the_same_as_far_as_it_can_be_told_without_rclcpp(tmp_path):
    cpp.run(HERE / "planner_node_test.cpp", tmp_path, includes=[HERE / "rclcpp_stand_in"])


def test_the_node_in_cpp_needs_no_other_file_than_the_page_names(tmp_path):
    page = (cpp.EXAMPLES.parent / "docs" / "planner.md").read_text()
    named = re.findall(r"`(\w+\.[ch]pp)`", page.split("\nIn C++, in a package of your own ")[1].split("```")[0])
    for name in named:
        shutil.copy(cpp.EXAMPLES / name, tmp_path)
    source, options = tmp_path / "planner.cpp", ("-c", "-o", str(tmp_path / "planner.o"))
    cpp.compile(source, *options, includes=[HERE / "rclcpp_stand_in"], examples=tmp_path)


def test_the_code_in_the_documentation_is_that_of_the_example():
    text = (cpp.EXAMPLES.parent / "docs" / "planner.md").read_text()
    snippets, code = re.findall(r"```python\n(.*?)```", text, re.DOTALL), (cpp.EXAMPLES / "planner.py").read_text()
    assert len(snippets) >= 3
    for snippet in snippets:
        assert snippet in code


class Told:
    """Says something ten times a second, until it is closed."""

    def __init__(self):
        self.over = threading.Event()
        self._thread = threading.Thread(target=self._go_on, daemon=True)
        self._thread.start()

    def _go_on(self):
        while not self.over.wait(0.1):
            self.tell()

    def close(self):
        self.over.set()
        self._thread.join()


class Robot(Told):
    """Says on /tf where it is, and hears `cmd_vel`."""

    def __init__(self, peer, frame="map"):
        self.frame, self.pose = frame, BASE
        self.commands = peer.record("/cmd_vel", Twist, qos(10))
        self._tf = peer.node.create_publisher(TFMessage, "/tf", qos(100))
        super().__init__()

    def tell(self):
        x, y, z, yaw = self.pose
        turn = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        transform = clouds.transform(self.frame, "base_link", (x, y, z), turn)
        self._tf.publish(clouds.stamped(transform, clouds.TF_STAMP, time.time_ns()))

    def stands(self, x, y, yaw, z=0.1):
        self.pose = (x, y, z, yaw)

    def expect(self, what, condition, steadily=5, timeout=60):
        """Waits until so many commands in a row meet the condition on the speed."""
        begin = len(self.commands)
        wait_until(what, lambda: len(self.commands) >= begin + steadily and all(
            condition(self.commands[-i].linear.x) for i in range(1, steadily + 1)), timeout)

    def expect_last(self, what, speed):
        """Waits until nothing more comes, and the last command is this."""
        def same():
            before = len(self.commands)
            time.sleep(0.3)
            return before == len(self.commands) and self.commands[before - 1].linear.x == speed

        wait_until(f"{what} as the last command", same)


@pytest.fixture
def robot(peer):
    robot = Robot(peer)
    yield robot
    robot.close()


class Map(Told):
    """Says that there is a floor, and no voxel: what the example drives by, without the program."""

    def __init__(self, peer):
        self.count = 0
        self._clusters = peer.node.create_publisher(SurfaceClusterArray, "/cfodi/clusters", qos(1, latched=True))
        self._points = peer.node.create_publisher(PointCloud2, "/cfodi/points_labelled", qos(5, reliable=False))
        super().__init__()

    def tell(self):
        self.count += 1
        floor = level(1, FLOOR, 0.0, (-5.0, 5.0), (-5.0, 5.0))
        map = SurfaceClusterArray(session_id=1, sequence=self.count, clusters=[floor])
        for publisher, message in ((self._clusters, map), (self._points, clouds_of([]))):
            message.header.frame_id = "map"
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(time.time_ns(), 10**9)
            publisher.publish(message)


@pytest.fixture
def floor(peer):
    floor = Map(peer)
    yield floor
    floor.close()


class Log(list):
    """The lines of a process so far, and the process."""

    def __init__(self, process):
        super().__init__()
        self.process = process
        self._reader = threading.Thread(target=lambda: self.extend(process.stdout), daemon=True)
        self._reader.start()

    def expect(self, text):
        return wait_until(f"the words: {text}", lambda: [line for line in self if text in line])

    def end(self):
        """Its exit status, when all that it said is here."""
        status = self.process.wait(timeout=60)
        self._reader.join()
        return status


@pytest.fixture
def drive(own_network):
    """Starts the example; its log is what it gives."""
    started = []

    def drive(remap=(), **parameters):
        given = [word for name, value in parameters.items() for word in ("-p", f"{name}:={value}")]
        given += [word for rule in remap for word in ("-r", rule)]
        command = [sys.executable, str(cpp.EXAMPLES / "planner.py"), "--ros-args", *given]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                   env=os.environ | {"PYTHONPATH": f"{cpp.EXAMPLES}:{os.environ['PYTHONPATH']}"})
        started.append(process)
        return Log(process)

    yield drive
    for process in started:
        process.kill()
        process.wait()


def test_it_finds_the_cabinets_top_and_stops_before_its_side(recordings, start, peer, robot, drive):
    remaps = {"depth/image": "/camera/depth/image_raw", "depth/camera_info": "/camera/depth/camera_info"}
    start(points=None, remaps=remaps).ready()
    peer.record_node()
    lines = drive(wished_height=0.6, max_age=600.0)
    camera = peer.depth_camera(depth_images.cabinet_info(recordings), "/compressedDepth")
    camera.meet()
    for scan in depth_images.cabinet(recordings, depth_images.compressed):
        before, stamp = len(peer.deltas), time.time_ns()
        camera.publish(scan.cloud, stamp, scan.transform)
        peer.deltas.wait("the scan's delta", lambda m: m.header.stamp.nanosec == stamp % 10**9, after=before)
    robot.stands(-2.3, 0.45, math.pi)
    robot.expect("full speed away from the cabinet", lambda speed: speed == pytest.approx(0.3))
    robot.stands(-3.0, 0.45, 0.0)
    robot.expect("less speed a metre before its side", lambda speed: speed == pytest.approx(0.17, abs=0.02))
    robot.stands(-2.3, 0.45, 0.0)
    robot.expect("no speed before its side", lambda speed: speed == 0.0)
    robot.stands(-2.3, 0.45, math.pi)
    robot.expect("full speed again", lambda speed: speed == pytest.approx(0.3))
    table = re.compile(r"table \d+: ([\d.]+) m high, ([\d.]+) x ([\d.]+) m")
    said = wait_until("the table", lambda: table.findall("".join(lines)))
    height, length, width = map(float, said[-1])
    lines.expect("the robot stands: an obstacle is ahead")
    assert height == pytest.approx(0.55, abs=0.04), "as its owners measured it"
    assert (length, width) == (pytest.approx(0.79, abs=0.08), pytest.approx(0.45, abs=0.08)), "within a voxel"


def test_it_stands_while_it_does_not_see_the_voxels(start, peer, robot, drive):
    start().ready()
    peer.record_node()
    lines = drive(speed=0.2, stop_before=0.3, max_age=600.0, remap=["/cfodi/points_labelled:=/nowhere"])
    camera = peer.camera()
    camera.meet()
    scene.show(camera, peer.deltas, scene.room())
    peer.deltas.wait("the ground", lambda m: m.clusters)
    robot.expect("no speed without the voxels", lambda speed: speed == 0.0, steadily=20)
    said = lines.expect("the robot stands: no cloud of labelled points has come")
    assert "net.core.rmem_default" in said[0]
    drive(speed=0.2, stop_before=0.3, max_age=600.0)
    robot.expect("some speed with them", lambda speed: speed > 0.1, steadily=1)


def test_it_stands_where_the_map_grows_old_or_there_is_no_ground(start, peer, robot, drive):
    start().ready()
    peer.record_node()
    lines = drive(speed=0.2, stop_before=0.3, max_age=3.0)
    camera = peer.camera()
    camera.meet()
    robot.expect("no speed without a map", lambda speed: speed == 0.0)
    said = lines.expect("the robot stands: no map has come")
    assert "takes in no scan" in said[0], "those of a program that has seen none come without a stamp"
    over = threading.Event()

    def keep_showing():
        while not over.wait(0.1):
            camera.publish(scene.room(), time.time_ns(), clouds.still_transform())

    shown = threading.Thread(target=keep_showing, daemon=True)
    shown.start()
    try:
        robot.expect("some speed towards the table", lambda speed: 0.1 < speed <= 0.2)
        robot.stands(0.0, 0.0, 0.0, z=3.0)
        robot.expect("no speed without ground", lambda speed: speed == 0.0)
        lines.expect("the robot stands: no floor is seen below the robot or up to 2.5 m ahead (its base frame is at (0, 0, 3))")
        robot.stands(0.0, 0.0, 0.0)
        robot.expect("some speed again", lambda speed: 0.1 < speed <= 0.2)
    finally:
        over.set()
        shown.join()
    robot.expect("no speed when the map is old", lambda speed: speed == 0.0)
    lines.expect("the robot stands: the map is too old (")


def test_it_stands_while_the_cameras_clock_is_ahead(start, peer, robot, drive):
    start().ready()
    peer.record_node()
    drive(speed=0.2, stop_before=0.3, max_age=600.0)
    camera = peer.camera()
    camera.meet()

    def show(ahead):
        for _ in range(scene.SCANS):
            before, stamp = len(peer.deltas), time.time_ns() + ahead
            camera.publish(scene.room(), stamp, clouds.still_transform())
            peer.deltas.wait("the scan's delta", lambda m: m.header.stamp.nanosec == stamp % 10**9, after=before)

    show(ahead=0)
    robot.expect("some speed towards the table", lambda speed: speed > 0.1)
    show(ahead=30 * 10**9)
    robot.expect("no speed by what is of half a minute hence", lambda speed: speed == 0.0)


def test_it_says_that_it_stands_while_there_is_no_clock(robot, drive):
    lines = drive(use_sim_time="true")
    robot.expect("no speed", lambda speed: speed == 0.0)
    lines.expect("the robot stands: no time has come on /clock")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_robot_and_ends_it_in_peace(robot, floor, drive, number):
    lines = drive()
    robot.expect("full speed", lambda speed: speed == pytest.approx(0.3))
    lines.process.send_signal(number)
    assert lines.end() == 0
    robot.expect_last("a stop", 0.0)
    assert not any("Traceback" in line or "Error" in line for line in lines), lines


def test_an_error_stops_the_robot_too(robot, floor, drive, peer):
    lines = drive()
    robot.expect("full speed", lambda speed: speed == pytest.approx(0.3))
    wrong = peer.node.create_publisher(PointCloud2, "/cfodi/points_labelled", qos(5, reliable=False))
    wait_until("the end by a cloud without fields", lambda: wrong.publish(PointCloud2()) or lines.process.poll() is not None)
    assert lines.end() != 0 and any("KeyError" in line for line in lines), lines
    robot.expect_last("a stop", 0.0)


@pytest.mark.parametrize("given, words", [
    ({"stop_before": 4.0}, "slow_from is 1.5 and stop_before is 4; slow_from must be more"),
    ({"speed": ".nan"}, "speed is nan; it must be a finite number and not below 0"),
    ({"speed": 1}, "expecting type 'DOUBLE'"),
])
def test_it_does_not_start_with_impossible_parameters(robot, floor, drive, given, words):
    lines = drive(**given)
    assert lines.end() == 2
    assert any(words in line for line in lines), lines
    assert not any("Traceback" in line for line in lines), lines
    assert not len(robot.commands)


def test_it_says_that_it_only_looks(robot, floor, drive):
    drive(speed=0.0).expect("the robot stands: the parameter speed is 0")
