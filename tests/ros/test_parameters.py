"""Parameters as in rclcpp: described, got, changed while the node runs, refused with a reason, dumped and loaded again."""

import math

import pytest
import yaml
from peer import qos, wait_until
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, GetParameterTypes, ListParameters, SetParameters, SetParametersAtomically)
from rosgraph_msgs.msg import Clock
from test_inputs import begin, take_in
from test_introspection import DEFAULTS, FIELD, parameters

TYPE = {bool: ParameterType.PARAMETER_BOOL, int: ParameterType.PARAMETER_INTEGER, float: ParameterType.PARAMETER_DOUBLE,
        str: ParameterType.PARAMETER_STRING, list: ParameterType.PARAMETER_STRING_ARRAY}
BIG, TINY = 1.7976931348623157e308, 5e-324

# Of each parameter: its range, another value that it can have (None: it is read when the node starts), one that it cannot
# have, and what must be said of that.
TABLE = {
    "fixed_frame": (None, None, "/", "the name of a frame, of at most 256 bytes"),
    "mode": (None, None, "fast", "`consistent` or `paper`"),
    "voxel_size": ((TINY, BIG), None, 0.0, "finite and above 0 m"),
    "min_points": ((1, 2**31), None, 0, "from 1 to 2147483648"),
    "depth": ((1, 8), None, 9, "from 1 to 8"),
    "max_normal_angle": ((0.0, math.pi / 2), None, 1.6, "from 0 to pi/2 rad"),
    "min_vicinity": ((1, 2**32 - 1), None, 0, "from 1 to 4294967295 pairs"),
    "expansion_interval": ((0, 2**32 - 1), 25, -1, "from 0 (never complete) to 4294967295 scans"),
    "noise_model": (None, None, "kinect_v2", "`kinect_v1` or `none`"),
    "pose_sigma": ((0.0, 1.0), None, -0.1, "from 0 to 1 m"),
    "clearing": (None, False, None, None),
    "max_voxels": ((0, 2**63 - 1), 5000, -1, "0 (no bound) or more"),
    "keep_radius": ((0.0, BIG), 7.5, -0.5, "finite and 0 m (no bound) or more"),
    "max_range": ((0.0, 1e6), 5.5, 2e6, "from 0 to 1000000 m"),
    "min_range": ((0.0, 1e6), 0.5, -1.0, "from 0 to 1000000 m"),
    "optical": (None, "yes", "perhaps", "`auto`, `yes` or `no`"),
    "max_points": ((1, 2**24), 1000, 0, "from 1 to 16777216"),
    "network_interfaces": (None, None, ["lo0"], "a list of IPv4 addresses"),
    "receive_buffer": ((4096, 2**30), None, 1, "from 4096 to 1073741824 bytes"),
    "tf_timeout": ((0.0, 60.0), 0.5, 61.0, "from 0 to 60 s"),
    "publish_rate": ((0.01, 100.0), 4.0, 0.0, "from 0.01 to 100 Hz"),
    "snapshot_path": (None, None, None, None),
    "snapshot_period": ((0.1, 86400.0), 9.0, 0.0, "from 0.1 to 86400 s"),
    "use_sim_time": (None, None, None, None),
    "twins": (None, None, None, None),
    "sensors": (None, None, ["a", "a"], "a list of 1 to 16 names"),
    "points.kind": (None, None, "lidar", "`cloud`, `depth` or `auto`"),
    "points.noise_model": (None, None, "kinect_v2", "`kinect_v1` or `none`"),
}
# Another value of what is read when the node starts.
FIXED = {
    "fixed_frame": "map", "mode": "paper", "voxel_size": 0.1, "min_points": 9, "depth": 3, "max_normal_angle": 0.4,
    "min_vicinity": 2, "noise_model": "none", "pose_sigma": 0.02, "network_interfaces": ["127.0.0.1"], "receive_buffer": 65536,
    "snapshot_path": "/tmp/map", "use_sim_time": True, "twins": ["detections"], "sensors": ["front"], "points.kind": "cloud",
    "points.noise_model": "none",
}


def message(name, value):
    return Parameter(name=name, value=ParameterValue(type=TYPE[type(value)], **{FIELD[TYPE[type(value)]]: value}))


def set_each(peer, values):
    request = SetParameters.Request(parameters=[message(*each) for each in values.items()])
    return peer.call(SetParameters, "/cfodi/set_parameters", request).results


def set_one(peer, name, value):
    return set_each(peer, {name: value})[0]


def plain(start):
    return start(fixed_frame=None, points=None).ready()


def test_every_parameter_is_described_with_its_range_and_whether_it_can_change(start, peer):
    plain(start)
    listed = peer.call(ListParameters, "/cfodi/list_parameters", ListParameters.Request()).result.names
    assert list(listed) == sorted(TABLE) == sorted(DEFAULTS)
    asked = DescribeParameters.Request(names=list(TABLE))
    described = peer.call(DescribeParameters, "/cfodi/describe_parameters", asked).descriptors
    types = peer.call(GetParameterTypes, "/cfodi/get_parameter_types", GetParameterTypes.Request(names=list(TABLE))).types
    for (name, (bounds, live, _, must)), descriptor, kind in zip(TABLE.items(), described, types, strict=True):
        assert (descriptor.name, descriptor.type) == (name, TYPE[type(DEFAULTS[name])])
        assert kind == descriptor.type and len(descriptor.description) > 10 and not descriptor.dynamic_typing
        assert descriptor.read_only == (live is None), name
        ranges = [(r.from_value, r.to_value) for r in (*descriptor.integer_range, *descriptor.floating_point_range)]
        assert ranges == ([bounds] if bounds else []), name
        if isinstance(DEFAULTS[name], (str, list)) and must:
            assert must in descriptor.additional_constraints, name


def test_what_is_live_takes_good_values_shows_them_and_tells_of_them(start, peer):
    node = plain(start)
    events = peer.record("/parameter_events", ParameterEvent, qos(100))
    # One of the peer, and of the node one that its library opens and never uses.
    wait_until("its publisher", lambda: peer.node.count_publishers("/parameter_events") == 3)
    live = {name: value for name, (_, value, *_) in TABLE.items() if value is not None}
    assert len(live) == 11
    for name, value in live.items():
        result = set_one(peer, name, value)
        assert result.successful and not result.reason, (name, result)
        assert parameters(peer, [name]) == {name: value}
        assert node.line_with(f"{name} is", "from now on, it was")
        told = events.wait(f"an event of {name}", lambda m, n=name: [c.name for c in m.changed_parameters] == [n])
        assert told.node == "/cfodi" and told.stamp.sec > 0 and not told.new_parameters and not told.deleted_parameters
        assert told.changed_parameters[0] == message(name, value)


def test_what_cannot_be_is_refused_with_its_name_and_its_bounds(start, peer):
    plain(start)
    before = parameters(peer, TABLE)
    for name, (_, _, bad, must) in TABLE.items():
        if must is not None:
            result = set_one(peer, name, bad)
            assert not result.successful and result.reason.startswith(f"{name} is ") and must in result.reason, result
        foreign = set_one(peer, name, 7 if isinstance(before[name], (bool, str, list)) else "wide")
        assert not foreign.successful and name in foreign.reason and "must be" in foreign.reason, foreign
    unknown = set_one(peer, "voxelsize", 0.1)
    assert not unknown.successful and "nearest known one is `voxel_size`" in unknown.reason
    contradicting = set_one(peer, "max_range", 0.1)
    assert contradicting.reason == "max_range is 0.1; it must be at least min_range, which is 0.4 m"
    contradicting = set_one(peer, "min_range", 7.0)
    assert contradicting.reason == "min_range is 7.0; it must be at most max_range, which is 6 m"
    assert parameters(peer, TABLE) == before


def test_what_is_read_at_the_start_stays_and_the_reason_says_what_to_do(start, peer):
    plain(start)
    assert sorted(FIXED) == sorted(name for name, (_, live, *_) in TABLE.items() if live is None)
    before = parameters(peer, FIXED)
    for name, value in FIXED.items():
        result = set_one(peer, name, value)
        assert not result.successful and f"start it again with -p {name}:=" in result.reason, (name, result)
        assert set_one(peer, name, before[name]).successful, f"{name} has this value"
    assert parameters(peer, FIXED) == before


def test_one_by_one_what_can_be_is_set_atomically_all_or_nothing(start, peer):
    plain(start)
    wanted = {"min_range": 1.5, "publish_rate": 0.0, "max_range": 4.5}
    assert [result.successful for result in set_each(peer, wanted)] == [True, False, True]
    assert parameters(peer, wanted) == {"min_range": 1.5, "publish_rate": 2.0, "max_range": 4.5}

    def atomically(values):
        request = SetParametersAtomically.Request(parameters=[message(*each) for each in values.items()])
        return peer.call(SetParametersAtomically, "/cfodi/set_parameters_atomically", request).result

    result = atomically({"min_range": 0.7, "max_points": 0})
    assert not result.successful and result.reason == "max_points is 0; it must be from 1 to 16777216"
    assert parameters(peer, ["min_range"]) == {"min_range": 1.5}
    # Each alone would contradict the other.
    assert atomically({"min_range": 5.0, "max_range": 9.0}).successful
    assert parameters(peer, ["min_range", "max_range"]) == {"min_range": 5.0, "max_range": 9.0}


def test_of_an_unknown_name_nothing_is_told_as_in_rclcpp(start, peer):
    plain(start)
    names = ["depth", "no_such"]
    assert not peer.call(GetParameters, "/cfodi/get_parameters", GetParameters.Request(names=names)).values
    assert not peer.call(GetParameterTypes, "/cfodi/get_parameter_types", GetParameterTypes.Request(names=names)).types
    described = peer.call(DescribeParameters, "/cfodi/describe_parameters", DescribeParameters.Request(names=names))
    assert not described.descriptors


@pytest.mark.timeout(120)
def test_publish_rate_takes_effect(start, peer):
    start({"publish_rate": 0.05}).ready()
    peer.record_node()
    assert set_one(peer, "publish_rate", 20.0).successful
    before = len(peer.clusters)
    wait_until("more snapshots than the rate before gives in minutes", lambda: len(peer.clusters) > before + 10, 30)


@pytest.mark.timeout(120)
def test_a_reader_that_listens_already_takes_the_new_range(start, peer):
    node, camera = begin(start, peer)
    first = take_in(camera, peer.deltas)
    assert first.clusters or first.unclustered_voxels
    # Both ends at once: nothing of a scan lies between them.
    request = SetParametersAtomically.Request(parameters=[message("min_range", 900.0), message("max_range", 901.0)])
    assert peer.call(SetParametersAtomically, "/cfodi/set_parameters_atomically", request).result.successful
    take_in(camera, peer.deltas)
    node.line_with("only 0 can be used", "out of range")


@pytest.mark.timeout(120)
def test_max_voxels_takes_effect_with_the_next_scan(start, peer):
    _, camera = begin(start, peer)
    take_in(camera, peer.deltas)

    def voxels(snapshot):
        return sum(cluster.voxel_count for cluster in snapshot.clusters) + snapshot.unclustered_voxels

    peer.clusters.wait("many voxels", lambda m: voxels(m) > 100, timeout=60)
    assert set_one(peer, "max_voxels", 50).successful
    take_in(camera, peer.deltas)
    peer.clusters.wait("few voxels", lambda m: m.sequence == 2 and voxels(m) <= 50, timeout=60)


@pytest.mark.timeout(120)
def test_use_sim_time_goes_by_clock(start, peer):
    start({"use_sim_time": "on"}).ready()
    assert parameters(peer, ["use_sim_time"]) == {"use_sim_time": True}
    events = peer.record("/parameter_events", ParameterEvent, qos(100))
    clock = peer.node.create_publisher(Clock, "/clock", qos(1, reliable=False))
    wait_until("a subscription of /clock", clock.get_subscription_count)
    time = Clock()
    time.clock.sec = 77
    rates = iter(range(1, 100))

    def told():
        clock.publish(time)
        set_one(peer, "publish_rate", float(next(rates)))
        return [e for e in map(events.__getitem__, range(len(events))) if e.stamp.sec == 77]

    wait_until("an event at the simulated time", told)


def dump(peer, file):
    """What `ros2 param dump /cfodi` writes."""
    names = peer.call(ListParameters, "/cfodi/list_parameters", ListParameters.Request()).result.names
    nested = {}
    for name, value in parameters(peer, names).items():
        *maps, last = name.split(".")
        place = nested
        for each in maps:
            place = place.setdefault(each, {})
        place[last] = value
    file.write_text(yaml.dump({"/cfodi": {"ros__parameters": nested}}, default_flow_style=False))


@pytest.mark.parametrize("given", [{}, {
    "fixed_frame": "map", "voxel_size": 0.1, "keep_radius": 20.0, "network_interfaces": "[127.0.0.1]", "optical": "yes",
    "noise_model": "none", "clearing": "false", "use_sim_time": "true", "max_voxels": 10**12, "snapshot_period": 1e-1,
}])
def test_a_dump_loads_again_and_gives_the_same_values(given, start, new_peer, tmp_path):
    file = tmp_path / "cfodi.yaml"
    first = start(given, fixed_frame=None, points=None).ready()
    peer = new_peer()
    dump(peer, file)
    before = parameters(peer, TABLE)
    first.stop()
    start(fixed_frame=None, points=None, arguments=["--params-file", str(file), "-r", "__node:=other"]).ready("/other")
    assert parameters(peer, TABLE, "/other") == DEFAULTS, "it is for another node"
    start(fixed_frame=None, points=None, arguments=["--params-file", str(file)]).ready()
    assert parameters(peer, TABLE) == before
