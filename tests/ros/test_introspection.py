"""How the node looks to ROS 2 tools: names, types, qualities of service, parameters."""

import pytest
from peer import wait_until
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

RELIABLE, BEST_EFFORT = ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT
LATCHED, VOLATILE = DurabilityPolicy.TRANSIENT_LOCAL, DurabilityPolicy.VOLATILE
PUBLISHED = {
    "/cfodi/clusters": ("cfodi_msgs/msg/SurfaceClusterArray", RELIABLE, LATCHED),
    "/cfodi/clusters_delta": ("cfodi_msgs/msg/SurfaceClusterArray", RELIABLE, VOLATILE),
    "/cfodi/markers": ("visualization_msgs/msg/MarkerArray", RELIABLE, LATCHED),
    "/cfodi/points_labelled": ("sensor_msgs/msg/PointCloud2", BEST_EFFORT, VOLATILE),
}
SUBSCRIBED = {
    "/points": ("sensor_msgs/msg/PointCloud2", BEST_EFFORT, VOLATILE),
    "/depth/image": ("sensor_msgs/msg/Image", BEST_EFFORT, VOLATILE),
    "/depth/camera_info": ("sensor_msgs/msg/CameraInfo", BEST_EFFORT, VOLATILE),
    "/tf": ("tf2_msgs/msg/TFMessage", RELIABLE, VOLATILE),
    "/tf_static": ("tf2_msgs/msg/TFMessage", RELIABLE, LATCHED),
}
DEFAULTS = {
    "fixed_frame": "odom", "mode": "consistent", "voxel_size": 0.08, "min_points": 15, "depth": 4, "max_normal_angle": 0.53,
    "min_vicinity": 1, "expansion_interval": 10, "noise_model": "kinect_v1", "pose_sigma": 0.0, "clearing": True, "max_voxels": 0,
    "keep_radius": 0.0, "max_range": 6.0, "min_range": 0.4, "optical": "auto",
    "max_points": 4_000_000, "network_interfaces": [], "receive_buffer": 32 << 20, "tf_timeout": 0.2, "publish_rate": 2.0,
    "use_sim_time": False, "snapshot_path": "", "snapshot_period": 60.0, "twins": [],
    "sensors": ["points"], "points.kind": "auto", "points.noise_model": "kinect_v1",
}
FIELD = {ParameterType.PARAMETER_BOOL: "bool_value", ParameterType.PARAMETER_INTEGER: "integer_value",
         ParameterType.PARAMETER_DOUBLE: "double_value", ParameterType.PARAMETER_STRING: "string_value",
         ParameterType.PARAMETER_STRING_ARRAY: "string_array_value"}


def parameters(peer, names, node="/cfodi"):
    reply = peer.call(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=list(names)))
    values = (getattr(value, FIELD[value.type]) if value.type in FIELD else f"type {value.type}" for value in reply.values)
    return {n: v if isinstance(v, (str, bool, int, float)) else list(v) for n, v in zip(names, values)}


def node_names(peer):
    return {namespace.rstrip("/") + "/" + name for name, namespace in peer.node.get_node_names_and_namespaces()}


def test_the_node_is_named_cfodi(start, peer):
    start(fixed_frame=None, points=None).ready()
    wait_until("/cfodi among the nodes", lambda: "/cfodi" in node_names(peer))


@pytest.mark.parametrize("found, expected", [("publishers", PUBLISHED), ("subscriptions", SUBSCRIBED)])
def test_the_topics_have_their_types_and_qualities_of_service(found, expected, start, peer):
    start(fixed_frame=None, points=None).ready()

    def infos_of(topic):
        return [i for i in getattr(peer.node, f"get_{found}_info_by_topic")(topic) if i.node_name == "cfodi"]

    wait_until(f"all {found}", lambda: all(infos_of(topic) for topic in expected))
    for topic, wanted in expected.items():
        qualities = [(i.topic_type, i.qos_profile.reliability, i.qos_profile.durability) for i in infos_of(topic)]
        # A raw depth image has a second reader, for publishers that send again what was lost; transforms have one that
        # waits for no heartbeat, and a camera's info one for what was said once before.
        second = {"/depth/image": (RELIABLE, VOLATILE), "/tf": (BEST_EFFORT, VOLATILE), "/depth/camera_info": (RELIABLE, LATCHED)}
        both = [wanted, (wanted[0], *second[topic])] if found == "subscriptions" and topic in second else [wanted]
        assert sorted(qualities) == sorted(both), topic


def test_the_services_are_there(start, peer):
    start(fixed_frame=None, points=None).ready()
    wanted = {f"/cfodi/{kind}_parameters": [f"rcl_interfaces/srv/{kind.title()}Parameters"]
              for kind in ("get", "set", "list", "describe")} | {f"/cfodi/{name}": ["std_srvs/srv/Trigger"] for name in ("reset", "save")}

    def offered():
        return dict(peer.node.get_service_names_and_types())

    wait_until("the services", lambda: wanted.items() <= offered().items())


def test_the_parameters_have_their_names_and_defaults(start, peer):
    start(fixed_frame=None, points=None).ready()
    listed = peer.call(ListParameters, "/cfodi/list_parameters", ListParameters.Request()).result.names
    assert set(DEFAULTS) <= set(listed)
    found = parameters(peer, DEFAULTS)
    assert {name: type(value) for name, value in found.items()} == {name: type(value) for name, value in DEFAULTS.items()}
    assert found == DEFAULTS


def test_names_of_topics_node_and_namespace_can_be_remapped(start, peer):
    start(remaps={"__node": "surfaces", "__ns": "/robot"}, points="/x").ready("/robot/surfaces")
    wait_until("the node under its name", lambda: "/robot/surfaces" in node_names(peer))
    wait_until("its topics", lambda: peer.node.count_publishers("/robot/surfaces/clusters"))
    wait_until("the remapped input", lambda: peer.node.count_subscribers("/x"))
    assert not peer.node.count_subscribers("/points") and not peer.node.count_subscribers("/robot/points")
    assert parameters(peer, ["fixed_frame"], "/robot/surfaces") == {"fixed_frame": "map"}


def test_in_the_papers_mode_nothing_is_cleared_and_the_parameters_say_so(start, peer):
    start({"mode": "paper"}, points=None).ready()
    assert parameters(peer, ["mode", "clearing"]) == {"mode": "paper", "clearing": False}


@pytest.mark.parametrize("key", ["/**", "/cfodi", "cfodi"])
def test_a_params_file_counts_and_p_wins_over_it(key, start, peer, tmp_path):
    file = tmp_path / "params.yaml"
    file.write_text(f"{key}:\n  ros__parameters:\n    voxel_size: 0.1\n    min_points: 20\n    max_range: 5\n")
    start({"min_points": 25, "min_range": 1}, fixed_frame=None, arguments=["--params-file", str(file)]).ready()
    wanted = {"voxel_size": 0.1, "min_points": 25, "max_range": 5.0, "min_range": 1.0, "fixed_frame": "odom"}
    assert parameters(peer, wanted) == wanted


def test_ros_domain_id_is_honoured(start, peer, new_peer):
    start(environment={"ROS_DOMAIN_ID": "7"}).ready()
    there = new_peer("there", domain=7)
    wait_until("the node in its domain", lambda: "/cfodi" in node_names(there))
    assert "/cfodi" not in node_names(peer)
