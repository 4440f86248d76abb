"""Keeps clear of obstacles and finds the table: `python3 planner.py --ros-args -p wished_height:=0.75`.

Drives straight on by `cmd_vel`, more slowly before an obstacle and not at all half a metre before it, and says where the
table is. An example: a robot needs an emergency stop beside it. docs/planner.md goes through it.
"""

import math

import numpy as np
from cfodi_msgs.msg import SurfaceCluster, SurfaceClusterArray
from map_reader import MapReader

LOW = 0.15  # what stands out less from the ground is no obstacle [m]: more than a depth camera's noise
ABOVE_GROUND = 0.3  # how high the origin of a base frame is at most [m]
LEVEL = (SurfaceCluster.CLASS_FLOOR, SurfaceCluster.CLASS_HORIZONTAL)


class Planner:
    """What a robot of this width and height [m] makes of the map; `robot` is its (x, y, z, yaw) in the map's frame."""

    def __init__(self, width, height):
        self.map, self.width, self.height = MapReader(), width, height
        self.voxels, self.labels, self.cloud = np.empty((0, 3)), np.empty(0), None  # outlines do not hold all, see docs/planner.md

    def points(self, cloud):
        """Takes a message of ~/points_labelled."""
        names, at = ["x", "y", "z", "label"], {field.name: field.offset for field in cloud.fields}
        points = np.frombuffer(cloud.data, np.dtype({"names": names, "formats": ["<f4", "<f4", "<f4", "<u4"],
                                                     "offsets": [at[name] for name in names], "itemsize": cloud.point_step}))
        self.cloud = cloud
        self.voxels, self.labels = np.stack([points["x"], points["y"], points["z"]], axis=-1), points["label"]

    def ground(self, robot):
        """What the robot stands on: the largest of the level surfaces under its base frame, or None."""
        under = [c for c in self.map.clusters.values()
                 if c.surface_class in LEVEL and abs(above(c, np.array(robot[:3]))) < ABOVE_GROUND]
        return max(under, key=lambda c: c.area, default=None)

    def table(self, ground, wished_height):
        """(height, cluster) of the raised level surface that is nearest to a height above the ground, or None."""
        level = [(above(ground, xyz(c.pose.position)), c) for c in self.map.clusters.values()
                 if c.surface_class == SurfaceCluster.CLASS_HORIZONTAL and c.state != SurfaceCluster.STATE_TENTATIVE]
        return min((t for t in level if t[0] > LOW), key=lambda t: abs(t[0] - wished_height), default=None)

    def free_ahead(self, ground, robot):
        """How far from its base frame the robot can drive straight on [m]; inf where nothing stands there."""
        heights = above(ground, self.voxels)
        things = [self.voxels[(self.labels != ground.id) & (heights > LOW) & (heights < self.height)]]
        for outline in (along(c.boundary) for c in self.map.clusters.values() if c.boundary.points):
            heights = above(ground, outline)
            if heights.max() > LOW and heights.min() < self.height:  # a wall is in the way though it ends above the robot
                things.append(outline)
        x, y = (np.concatenate(things)[:, :2] - robot[:2]).T
        ahead, left = math.cos(robot[3]) * x + math.sin(robot[3]) * y, math.cos(robot[3]) * y - math.sin(robot[3]) * x
        return ahead[(ahead > 0) & (abs(left) < self.width / 2)].min(initial=math.inf)


def xyz(point):
    return np.array([point.x, point.y, point.z])


def above(cluster, points):
    """How high points are above a cluster's plane [m]."""
    return points @ cluster.plane.coef[:3] + cluster.plane.coef[3]


def along(boundary, step=0.05):
    """Points along an outline."""
    corners = np.array([xyz(corner) for corner in boundary.points])
    sides = np.roll(corners, -1, axis=0) - corners
    return np.concatenate([corner + np.arange(0, 1, step / max(np.linalg.norm(side), step))[:, None] * side
                           for corner, side in zip(corners, sides)])


def main():
    import rclpy
    from geometry_msgs.msg import Twist
    from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
    from rclpy.time import Time
    from sensor_msgs.msg import PointCloud2
    from tf2_msgs.msg import TFMessage

    rclpy.init()
    node = rclpy.create_node("planner")
    defaults = {"base_frame": "base_link", "width": 0.5, "height": 1.2, "wished_height": 0.75, "speed": 0.3,
                "stop_before": 0.5, "slow_from": 1.5, "max_age": 1.0}
    given = {name: node.declare_parameter(name, default).value for name, default in defaults.items()}
    planner, poses = Planner(given["width"], given["height"]), {}
    commands = node.create_publisher(Twist, "cmd_vel", 1)

    def transforms(message):
        poses.update((t.header.frame_id, t) for t in message.transforms if t.child_frame_id == given["base_frame"])

    def is_fresh(message):
        return message and (node.get_clock().now() - Time.from_msg(message.header.stamp)).nanoseconds < given["max_age"] * 1e9

    def speed():
        latest = planner.map.latest
        pose = poses.get(latest.header.frame_id) if latest else None
        if not (is_fresh(latest) and is_fresh(planner.cloud) and is_fresh(pose)):
            return 0.0  # a robot that sees nothing, or does not know where it is, stands
        q = pose.transform.rotation
        yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
        robot = (*xyz(pose.transform.translation), yaw)
        if (ground := planner.ground(robot)) is None:
            return 0.0
        if found := planner.table(ground, given["wished_height"]):
            height, table = found
            p, q = table.pose.position, table.pose.orientation
            node.get_logger().info(
                f"table {table.id}: {height:.2f} m high, {table.size.x:.2f} x {table.size.y:.2f} m, middle ({p.x:.2f}, "
                f"{p.y:.2f}, {p.z:.2f}), turned ({q.x:.2f}, {q.y:.2f}, {q.z:.2f}, {q.w:.2f})", throttle_duration_sec=1.0)
        free = planner.free_ahead(ground, robot) - given["stop_before"]
        return given["speed"] * min(max(free / (given["slow_from"] - given["stop_before"]), 0.0), 1.0)

    def drive():
        command = Twist()
        command.linear.x = speed()
        commands.publish(command)

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_subscription(SurfaceClusterArray, "/cfodi/clusters", planner.map.snapshot, latched)
    node.create_subscription(SurfaceClusterArray, "/cfodi/clusters_delta", planner.map.delta, 20)
    node.create_subscription(PointCloud2, "/cfodi/points_labelled", planner.points, qos_profile_sensor_data)
    node.create_subscription(TFMessage, "/tf", transforms, 100)
    node.create_timer(0.1, drive)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
