"""Keeps clear of obstacles and finds the table: `python3 planner.py --ros-args -p wished_height:=0.75`.

Drives straight on by `cmd_vel`, more slowly before an obstacle and not at all half a metre before it, and says where the
table is, or why it stands. An example: a robot needs an emergency stop beside it. docs/planner.md goes through it.
"""

import math
import signal
import sys
import time

import numpy as np
from cfodi_msgs.msg import SurfaceCluster, SurfaceClusterArray
from map_reader import MapReader

LOW = 0.15  # what stands out less from the ground is no obstacle [m]: more than a depth camera's noise
ABOVE_GROUND = (-0.05, 0.3)  # how high the origin of a base frame is [m]: below 0 by noise, not by a step
UNSEEN = 2.5  # within this the ground may begin [m]: a level Kinect 1 m up sees none nearer
AHEAD = 0.2  # a stamp may be ahead of the clock by this [s]: the clocks of two machines are not set more exactly
TILT = 0.05  # what rises by more in a metre is not level [m/m]: in three it would hide an obstacle of `LOW`
CONFIDENT = 0.3  # less is a guess: FLOOR and HORIZONTAL, which are one to a ground, may have a half each
FACES_UP = 0.9  # the least z of the normal of what can carry the robot: up to 26 degrees
LEVEL = (SurfaceCluster.CLASS_FLOOR, SurfaceCluster.CLASS_HORIZONTAL)
MAP, LABELLED = "map", "cloud of labelled points"
HINTS = {MAP: "cfodi is not heard, or takes in no scan", LABELLED: "large ones are lost where net.core.rmem_default is small"}
PARAMETERS = {"base_frame": "base_link", "width": 0.5, "height": 1.2, "wished_height": 0.75, "speed": 0.3, "stop_before": 0.5,
              "slow_from": 1.5, "max_age": 1.0}


class Planner:
    """What a robot of this width and height [m] makes of the map; `robot` is its (x, y, z, yaw) in the map's frame."""

    def __init__(self, width, height):
        self.map, self.width, self.height = MapReader(), width, height
        self.voxels, self.cloud = np.empty((0, 3)), None  # outlines do not hold all, see docs/planner.md
        self.outlines = {}  # by id, each with the cluster that it is of: one that has changed comes as another

    def points(self, cloud):
        """Takes a message of ~/points_labelled."""
        at = {field.name: field.offset for field in cloud.fields}
        points = np.frombuffer(cloud.data, np.dtype({"names": ["x", "y", "z"], "formats": 3 * ["<f4"],
                                                     "offsets": [at[axis] for axis in "xyz"], "itemsize": cloud.point_step}))
        self.cloud, self.voxels = cloud, np.stack([points["x"], points["y"], points["z"]], axis=-1)

    def ground(self, robot):
        """What the robot stands on: of the surfaces at its height the one that it is over or comes to first. None where that is
        not known to be level: a level one further ahead may be the foot of a ramp."""
        first = self.stands_on(robot)
        return first if first and is_level(first) else None

    def stands_on(self, robot):
        """That surface, level or not; None where none is seen."""
        found = [(c.state == SurfaceCluster.STATE_TENTATIVE, self.begins(c, c, robot, -LOW, LOW), not is_level(c), height, c)
                 for height, c in self.under(robot)]
        return min((f for f in found if f[1] < UNSEEN), key=lambda f: f[:4], default=(None,))[-1]

    def no_ground(self, robot):
        """Why there is no ground: a reason and its numbers."""
        if (first := self.stands_on(robot)) is None:
            at = ", ".join(f"{c:.4g}" for c in robot[:3])
            return f"no floor is seen below the robot or up to {UNSEEN:g} m ahead", f"its base frame is at ({at})"
        rise, known = math.hypot(*first.plane.coef[:2]), math.sqrt(max(first.plane_covariance[0], first.plane_covariance[4], 0.0))
        return ("what is below the robot or first ahead is not known to be level",
                f"cluster {first.id}: class {first.surface_class}, confidence {first.class_confidence:.4g}, "
                f"rises by {rise:.4g} m/m, which is known to {known:.4g}")

    def under(self, robot):
        """(height of the base frame above it, cluster) of what faces up at the robot's height."""
        lowest, highest = ABOVE_GROUND
        up = [(above(c, np.array(robot[:3])), c) for c in self.map.clusters.values() if c.plane.coef[2] > FACES_UP]
        # The plane of what is not level may as well be off upwards: the robot is over it all the same.
        return [(height, c) for height, c in up if (lowest if is_level(c) else -highest) < height < highest]

    def table(self, ground, wished_height):
        """(height, cluster) of the raised level surface that is nearest to a height above the ground, or None."""
        raised = [(above(ground, xyz(c.pose.position)), c) for c in self.map.clusters.values() if is_level(c)
                  and c.surface_class == SurfaceCluster.CLASS_HORIZONTAL and c.state != SurfaceCluster.STATE_TENTATIVE]
        return min((t for t in raised if t[0] > LOW), key=lambda t: abs(t[0] - wished_height), default=None)

    def free_ahead(self, ground, robot):
        """How far from its base frame the robot can drive straight on [m]; inf where nothing stands there."""
        self.outlines = {each: self.outlines[each] for each in self.map.clusters.keys() & self.outlines.keys()}
        ahead, left, height = from_robot(robot, ground, self.voxels).T
        in_way = (ahead > 0) & (abs(left) < self.width / 2) & (height > LOW) & (height < self.height)
        clusters = (c for c in self.map.clusters.values() if c.id != ground.id)
        return min([ahead[in_way].min(initial=math.inf), *(self.begins(c, ground, robot, LOW, self.height) for c in clusters)])

    def begins(self, cluster, ground, robot, low, high):
        """How far ahead a cluster begins in the robot's lane between two heights above the ground [m]; inf where it does not."""
        least, most = np.array([0.0, -self.width / 2, low]), np.array([math.inf, self.width / 2, high])
        sides = from_robot(robot, ground, self.outline(cluster))
        # A surface is flat: what of it is nearest is at its outline, or else where it meets an end or a side of the lane.
        ends = [cut(sides, axis, at) for axis, at in ((0, least[0]), (1, least[1]), (1, most[1]))]
        return nearest(np.concatenate([sides, *ends]), least, most)

    def outline(self, cluster):
        """The sides of its outline, put together once."""
        of, sides = self.outlines.get(cluster.id, (None, None))
        if of is not cluster:
            sides = outline(cluster)
            self.outlines[cluster.id] = cluster, sides
        return sides


class Freshness:
    """Whether map, voxels and pose are of now. A clock can be set, differ from the camera's and stand still, so a stamp must
    be near the clock, and have come not long ago by a clock that nobody sets."""

    def __init__(self, max_age):
        self.max_age, self.came = max_age, {}

    def lacks(self, stamps, now, steady):
        """Which of these is not of now: a reason and its numbers, None where all are. `stamps`, by name, and `now` are of one
        clock, `steady` of a steady one [s]; a time of 0 is none. Asked again and again."""
        before = self.came
        self.came = {what: before[what] if what in before and before[what][0] == stamp
                     else (stamp, steady, what in before and before[what][0] > 0.0) for what, stamp in stamps.items()}
        if now <= 0.0:
            return "no time has come on /clock", "use_sim_time asks for it"
        found = (self.lack(what, stamp, now - stamp, steady - since, again) for what, (stamp, since, again) in self.came.items())
        return next((lack for lack in found if lack), None)

    def lack(self, what, stamp, age, since, again):
        """The same of one of them, by its age and how long ago it came [s], and whether one came before."""
        lags = again and age >= self.max_age and since < self.max_age
        hint = "it comes, and its stamps are behind the clock" if lags else HINTS.get(what, "")
        allowed = f"max_age is {self.max_age:.4g} s" + ("; " + hint if hint else "")
        if stamp <= 0.0:
            return f"no {what} has come", hint
        if age >= self.max_age:
            return f"the {what} is too old", f"{age:.4g} s, {allowed}"
        if age <= -AHEAD:
            return f"the {what} is ahead of the clock", f"by {-age:.4g} s: two clocks differ"
        if since >= self.max_age:
            return f"no new {what} comes", f"for {since:.4g} s, {allowed}"
        return None


class Driver:
    """How fast the robot drives by what has come, and why it stands. `given` are PARAMETERS: ValueError for impossible ones."""

    def __init__(self, given):
        if why := impossible(given):
            raise ValueError(why)
        self.given, self.poses, self.table = given, {}, None  # (height, cluster) of the table, None while it does not see one
        self.planner, self.freshness = Planner(given["width"], given["height"]), Freshness(given["max_age"])
        self.base_frame, self.session_id = bare(given["base_frame"]), None  # the session of the first map that it has driven by

    def transforms(self, message):
        """Takes a message of /tf."""
        self.poses.update((bare(t.header.frame_id), t) for t in message.transforms if bare(t.child_frame_id) == self.base_frame)

    def speed(self, now, steady):
        """(speed [m/s], why it stands: a reason and its numbers, or None). By two clocks, as `Freshness.lacks` has it."""
        planner, given, self.table = self.planner, self.given, None
        latest = planner.map.latest
        frame = latest.header.frame_id if latest else ""
        pose = self.poses.get(frame)
        stamps = {MAP: seconds(latest), LABELLED: seconds(planner.cloud),
                  f"transform from `{frame}` straight to `{self.base_frame}`": seconds(pose)}
        if lack := self.freshness.lacks(stamps, now, steady) or self.differs(frame):
            return 0.0, lack  # a robot that sees nothing, or does not know where it is, stands
        if not is_place(pose.transform):
            return 0.0, ("the robot's transform is no place", numbers(pose.transform))
        robot = place(pose.transform)
        if (ground := planner.ground(robot)) is None:
            return 0.0, planner.no_ground(robot)
        self.table = planner.table(ground, given["wished_height"])
        return self.before(planner.free_ahead(ground, robot))

    def differs(self, frame):
        """Whether what has come does not belong together: a reason and its numbers, None where it does."""
        if (other := self.planner.cloud.header.frame_id) != frame:
            return "map and labelled points are in different frames", f"`{frame}` and `{other}`: are they of one node?"
        session_id = self.planner.map.session_id
        self.session_id = self.session_id or session_id
        if session_id != self.session_id:  # what stands before the robot may be too near to be seen again
            return "a new session has begun, which may know nothing of what was seen before", "see that the way is free and start again"
        return None

    def before(self, free):
        """The same, where the robot can drive so far straight on [m]."""
        speed, stop_before, slow_from = (self.given[name] for name in ("speed", "stop_before", "slow_from"))
        if free <= stop_before:
            return 0.0, ("an obstacle is ahead", f"{free:.4g} m from the base frame, stop_before is {stop_before:.4g} m")
        if speed == 0.0:
            return 0.0, ("the parameter speed is 0", "")
        return speed * min((free - stop_before) / (slow_from - stop_before), 1.0), None


class Standing:
    """Puts into words why the robot stands: when the reason is a new one, though not more than once a second, and every 5 s."""

    def __init__(self):
        self.reason, self.said = None, -math.inf

    def line(self, why, steady):
        """What to say now, by a steady clock [s], or None; `why` is a reason and its numbers, None while the robot drives."""
        if why is None:
            self.reason = None
            return None
        reason, numbers = why
        if steady - self.said < (5.0 if reason == self.reason else 1.0):
            return None
        self.reason, self.said = reason, steady
        return f"the robot stands: {reason}" + (f" ({numbers})" if numbers else "")


def impossible(given):
    """Why nobody can drive by these parameters, with their numbers, or None."""
    for name, value in given.items():
        if name != "base_frame" and not 0.0 <= value < math.inf:
            return f"{name} is {value:.4g}; it must be a finite number and not below 0"
    for name, least in (("width", 0.0), ("height", LOW), ("max_age", 0.0)):
        if given[name] <= least:
            return f"{name} is {given[name]:.4g}; it must be more than {least:.4g}"
    if given["slow_from"] <= given["stop_before"]:
        return (f"slow_from is {given['slow_from']:.4g} and stop_before is {given['stop_before']:.4g}; slow_from must be more, "
                "for the robot slows down between the two")
    return None


def seconds(message):
    """The stamp of a message; 0 where there is none."""
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec if message else 0.0


def bare(frame):
    """The name of a frame without the slash that ROS 1 has before it, as cfodi takes it."""
    return frame.lstrip("/")


def xyz(point):
    return np.array([point.x, point.y, point.z])


def place(transform):
    """(x, y, z, yaw) of a frame in the one above it."""
    q = transform.rotation
    return (*xyz(transform.translation), math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z)))


def is_place(transform):
    """Whether it is one: an odometry that has lost itself may send no numbers, or no rotation, which cfodi and tf2 refuse."""
    q = transform.rotation
    return bool(np.isfinite(xyz(transform.translation)).all()) and abs(math.hypot(q.x, q.y, q.z, q.w) - 1.0) < 0.01


def numbers(transform):
    """Its own, in words."""
    at, q = transform.translation, transform.rotation
    return f"translation ({at.x:.4g}, {at.y:.4g}, {at.z:.4g}), rotation ({q.x:.4g}, {q.y:.4g}, {q.z:.4g}, {q.w:.4g})"


def above(cluster, points):
    """How high points are above a cluster's plane [m]."""
    return points @ cluster.plane.coef[:3] + cluster.plane.coef[3]


def is_level(cluster):
    """Whether a surface is known to be level: heights count from its plane, and things can be put on it."""
    turns = cluster.plane_covariance[0], cluster.plane_covariance[4]  # NaN where they are not known, which is less than nothing
    return (cluster.surface_class in LEVEL and cluster.class_confidence > CONFIDENT
            and math.hypot(*cluster.plane.coef[:2]) < TILT and all(turn < TILT**2 for turn in turns))


def from_robot(robot, ground, points):
    """How far ahead and left of the robot points are, and how high above the ground."""
    away, (x, y) = points[..., :2] - robot[:2], (math.cos(robot[3]), math.sin(robot[3]))
    return np.stack([away @ (x, y), away @ (-y, x), above(ground, points)], axis=-1)


def outline(cluster):
    """The sides of boundary and holes, each from a corner to the next."""
    rings = [np.array([xyz(corner) for corner in ring.points]).reshape(-1, 3) for ring in (cluster.boundary, *cluster.holes)]
    return np.concatenate([np.stack([ring, np.roll(ring, -1, axis=0)], axis=1) for ring in rings])


def cut(sides, axis, at):
    """The pieces of what the sides enclose on the plane where this coordinate is `at`: a doorway is between two of them."""
    crossing = sides[(sides[:, 0, axis] > at) != (sides[:, 1, axis] > at)]
    if not len(crossing):
        return crossing
    begin, way = crossing[:, 0], crossing[:, 1] - crossing[:, 0]
    points = begin + ((at - begin[:, axis]) / way[:, axis])[:, None] * way
    order = np.argsort(points[:, np.ptp(points, axis=0).argmax()])  # they lie on a line: a wall's go up, a table's ahead
    return points[order].reshape(-1, 2, 3)


def nearest(pieces, least, most):
    """The least distance ahead of what is in a box; a piece goes from one point to another."""
    least, most = least - 1e-9, most + 1e-9  # what is cut at the lane's sides is within it, rounded or not
    begin, way = pieces[:, 0], pieces[:, 1] - pieces[:, 0]
    way = np.where(way == 0.0, 1e-12, way)  # no division by 0
    one, other = (least - begin) / way, (most - begin) / way  # where it comes into the box and leaves it, as shares of the way
    shares = np.stack([np.minimum(one, other).max(axis=1, initial=0.0), np.maximum(one, other).min(axis=1, initial=1.0)])
    within = shares[0] <= shares[1]
    return (begin[within, 0] + shares[:, within] * way[within, 0]).clip(0.0).min(initial=math.inf)


def say_table(logger, height, table):
    p, q = table.pose.position, table.pose.orientation
    logger.info(f"table {table.id}: {height:.2f} m high, {table.size.x:.2f} x {table.size.y:.2f} m, middle ({p.x:.2f}, "
                f"{p.y:.2f}, {p.z:.2f}), turned ({q.x:.2f}, {q.y:.2f}, {q.z:.2f}, {q.w:.2f})", throttle_duration_sec=1.0)


def drive(node, driver, ended):
    """Until something stands in the list `ended`."""
    from geometry_msgs.msg import Twist
    from rclpy.clock import Clock, ClockType
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
    from sensor_msgs.msg import PointCloud2
    from tf2_msgs.msg import TFMessage

    planner, standing = driver.planner, Standing()
    commands = node.create_publisher(Twist, "cmd_vel", 1)

    def command():
        twist, steady = Twist(), time.monotonic()
        twist.linear.x, why = driver.speed(1e-9 * node.get_clock().now().nanoseconds, steady)
        commands.publish(twist)
        if line := standing.line(why, steady):
            node.get_logger().info(line)
        if driver.table:
            say_table(node.get_logger(), *driver.table)

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(SurfaceClusterArray, "/cfodi/clusters", planner.map.snapshot, latched)
    node.create_subscription(SurfaceClusterArray, "/cfodi/clusters_delta", planner.map.delta, 20)
    node.create_subscription(PointCloud2, "/cfodi/points_labelled", planner.points, qos_profile_sensor_data)
    node.create_subscription(TFMessage, "/tf", driver.transforms, 100)
    node.create_timer(0.1, command, clock=Clock(clock_type=ClockType.STEADY_TIME))  # a base keeps the last: /clock can stop
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        while not ended:
            executor.spin_once(timeout_sec=0.1)
    finally:
        commands.publish(Twist())  # the last one that a base may keep
        time.sleep(0.2)  # the middleware sends it, and again where it was lost


def main():
    import rclpy
    from rclpy.exceptions import ParameterException
    from rclpy.signals import SignalHandlerOptions

    ended = []
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, lambda number, _: ended.append(number))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # its own shut ROS down at once, and no stop could be sent
    node = rclpy.create_node("planner")
    try:
        driver = Driver({name: node.declare_parameter(name, default).value for name, default in PARAMETERS.items()})
    except (ParameterException, ValueError) as error:
        node.get_logger().fatal(str(error))
        return 2
    drive(node, driver, ended)
    rclpy.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
