"""Surfaces beside any driver of point clouds:  ros2 launch cfodi cloud.launch.py points:=/camera/depth/points"""

import pathlib

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource

NODE = str(pathlib.Path(__file__).with_name("node.launch.py"))


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument("points", default_value="/camera/depth/points", description="topic of point clouds"),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(NODE)),
    ])
