"""A bag played beside the live node, on the bag's time, with RViz:
ros2 launch cfodi replay.launch.py bag:=DIR points:=/camera/depth/points

Every scan, as fast as the processor allows, is `cfodi replay`.
"""

import pathlib

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

NODE = str(pathlib.Path(__file__).with_name("node.launch.py"))


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument("bag", description="folder or file of the bag"),
        DeclareLaunchArgument("rate", default_value="1.0", description="of playing, against the time of recording"),
        DeclareLaunchArgument("delay", default_value="3.0", description="seconds for all to meet before the first message"),
        DeclareLaunchArgument("use_sim_time", default_value="true", choices=["", "true", "false"], description="follow /clock"),
        DeclareLaunchArgument("rviz", default_value="true", choices=["true", "false"], description="show the map"),
        IncludeLaunchDescription(PythonLaunchDescriptionSource(NODE)),
        ExecuteProcess(cmd=["ros2", "bag", "play", LaunchConfiguration("bag"), "--clock", "--rate", LaunchConfiguration("rate"),
                            "--delay", LaunchConfiguration("delay")], output="screen"),
    ])
