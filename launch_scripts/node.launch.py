"""The node with every input, and RViz. cloud, kinect_v1 and replay include it.

What is given here overrides params_file; what is left empty is as params_file says (RViz does not read that file).
"""

import pathlib

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

HERE = pathlib.Path(__file__).parent
PUBLISHED = ("clusters", "clusters_delta", "markers", "points_labelled")


def start(context):
    given = {name: LaunchConfiguration(name).perform(context) for name in ("name", "namespace", "fixed_frame", "use_sim_time")}
    name, namespace, fixed_frame, use_sim_time = given.values()
    clock = {"use_sim_time": use_sim_time == "true"} if use_sim_time else {}
    frame = {"fixed_frame": ParameterValue(fixed_frame, value_type=str)} if fixed_frame else {}
    own = [clock | frame] if clock | frame else []
    resume = ["--resume"] if LaunchConfiguration("resume").perform(context) == "true" else []
    inputs = {"points": "points", "depth/image": "image", "depth/camera_info": "camera_info"}
    return [
        Node(package="cfodi", executable="cfodi", name=name, namespace=namespace, output="screen",
             sigterm_timeout="15",  # after SIGINT; at the second signal a map that is still being written is given up
             arguments=["run", *resume], ros_arguments=["--log-level", LaunchConfiguration("log_level")],
             parameters=[LaunchConfiguration("params_file"), *own],
             remappings=[(topic, LaunchConfiguration(argument)) for topic, argument in inputs.items()]),
        Node(package="rviz2", executable="rviz2", namespace=namespace, condition=IfCondition(LaunchConfiguration("rviz")),
             arguments=["-d", str(HERE / "cfodi.rviz"), *(["-f", fixed_frame] if fixed_frame else [])],
             parameters=[clock] if clock else [],
             remappings=[("/points", LaunchConfiguration("points")), *((f"/cfodi/{t}", f"{name}/{t}") for t in PUBLISHED)]),
    ]


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument("points", default_value="points", description="topic of point clouds"),
        DeclareLaunchArgument("image", default_value="depth/image", description="topic of depth images"),
        DeclareLaunchArgument("camera_info", default_value="depth/camera_info", description="their camera info"),
        DeclareLaunchArgument("name", default_value="cfodi", description="name of the node"),
        DeclareLaunchArgument("namespace", default_value="", description="namespace of node and topics"),
        DeclareLaunchArgument("params_file", default_value=str(HERE.parent / "config" / "kinect.yaml"),
                              description="parameters of the node"),
        DeclareLaunchArgument("fixed_frame", default_value="", description="frame of the map"),
        DeclareLaunchArgument("use_sim_time", default_value="", choices=["", "true", "false"], description="follow /clock"),
        DeclareLaunchArgument("resume", default_value="false", choices=["true", "false"],
                              description="go on with the map that the parameter snapshot_path names"),
        DeclareLaunchArgument("rviz", default_value="false", choices=["true", "false"], description="show the map"),
        DeclareLaunchArgument("log_level", default_value="info", choices=["debug", "info", "warn", "error", "fatal"],
                              description="of the node"),
        OpaqueFunction(function=start),
    ])
