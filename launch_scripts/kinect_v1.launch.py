"""Surfaces from the depth images of a Kinect v1 (driver kinect_ros2), and where it stands on the robot, which the driver does
not tell:  ros2 launch cfodi kinect_v1.launch.py x:=0.1 z:=0.4 pitch:=0.2

kinect_link stands at x y z (m), turned by roll pitch yaw (rad), in parent_frame: x looks ahead, z up, a pitch above zero down.
"""

import math
import pathlib

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.conditions import IfCondition
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

NODE = str(pathlib.Path(__file__).with_name("node.launch.py"))
POSE = ("x", "y", "z", "roll", "pitch", "yaw")
OPTICAL = {"roll": str(-math.pi / 2), "yaw": str(-math.pi / 2)}  # of a frame with z ahead and y down


def static_transform(name, pose, parent, child):
    arguments = [word for key, value in pose.items() for word in (f"--{key}", value)]
    return Node(package="tf2_ros", executable="static_transform_publisher", name=name,
                namespace=LaunchConfiguration("namespace"), condition=IfCondition(LaunchConfiguration("transform")),
                arguments=[*arguments, "--frame-id", parent, "--child-frame-id", child])


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument("image", default_value="depth/image_raw", description="topic of depth images"),
        DeclareLaunchArgument("camera_info", default_value="depth/camera_info", description="their camera info"),
        DeclareLaunchArgument("transform", default_value="true", choices=["true", "false"],
                              description="tell where the Kinect stands"),
        DeclareLaunchArgument("parent_frame", default_value="base_link", description="frame that it stands in"),
        DeclareLaunchArgument("sensor_frame", default_value="kinect_depth", description="frame of the depth images"),
        *(DeclareLaunchArgument(name, default_value="0.0", description="of kinect_link in parent_frame") for name in POSE),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(NODE)),
        static_transform("kinect_mount", {name: LaunchConfiguration(name) for name in POSE},
                         LaunchConfiguration("parent_frame"), "kinect_link"),
        static_transform("kinect_optics", OPTICAL, "kinect_link", LaunchConfiguration("sensor_frame")),
    ])
