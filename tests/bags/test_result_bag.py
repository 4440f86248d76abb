"""RESULT.mcap: what other programs make of it."""

import math
import struct
from collections import Counter

import bags
import pytest
from map_reader import MapReader
from replay import Replay
from result import DELTA, SNAPSHOT, TOPICS, ResultBag, plain, stamp
from test_outputs import CLUSTER


@pytest.fixture
def run(recording):
    return recording("cabinet").replay()


@pytest.fixture(scope="session")
def _read():
    return {}


@pytest.fixture
def result(run, _read):
    """Decoded once for all tests."""
    if not _read:
        _read["result"] = ResultBag(run.path("out"))
    return _read["result"]


@pytest.mark.parametrize("topic, kind", TOPICS.items())
def test_every_topic_is_there_with_its_type_and_schema(topic, kind, result):
    assert topic in result.schemas, f"only {sorted(result.schemas)}"
    schema = result.schemas[topic]
    assert (schema.name, schema.encoding) == (kind, "ros2msg")
    assert result.channels[topic].message_encoding == "cdr"
    assert result.on(topic), "no message on it"


def test_the_cluster_schema_is_that_of_the_interface_package(result):
    own, *others = result.schemas["/cfodi/clusters"].data.decode().split("=" * 80)
    written = {part.split("\n", 2)[1].strip(): part.split("\n", 2)[2] for part in others}
    assert fields(own) == fields((bags.REPOSITORY / "msg" / "SurfaceClusterArray.msg").read_text())
    assert fields(written["MSG: cfodi_msgs/SurfaceCluster"]) == fields(
        (bags.REPOSITORY / "msg" / "SurfaceCluster.msg").read_text())


def fields(definition):
    """Type and name of each field and constant; `package/Type` and `Type` are one."""
    lines = (line.split("#")[0].split() for line in definition.splitlines())
    return [(line[0].split("/")[-1], "".join(line[1:])) for line in lines if line]


def test_the_bag_is_one_of_ros_2_with_a_summary(result):
    assert result.header.profile == "ros2"
    assert result.statistics.message_count == len(result.messages)
    assert result.statistics.chunk_count > 0
    latched = result.channels["/cfodi/clusters"].metadata.get("offered_qos_profiles", "")
    assert "durability" in latched, "a player offers snapshots as the node does: transient local"


def test_log_times_are_stamps_in_order(result, recording):
    clouds = [stamp(m.header) for _, _, m in bags.messages(recording("cabinet").folder(), bags.POINTS)]
    for message in result.messages:
        assert message.log_time == message.publish_time
        if hasattr(message.value, "header"):
            assert stamp(message.value.header) == message.log_time
        if message.topic == "/cfodi/markers":
            assert {stamp(m.header) for m in message.value.markers if m.action == 0} <= {message.log_time}
    assert [m.log_time for m in result.on("/cfodi/clusters_delta")] == clouds
    for topic in result.schemas:
        times = [message.log_time for message in result.on(topic)]
        assert times == sorted(times)
        assert set(times) <= set(clouds) or topic == "/tf_static"


def test_the_last_snapshot_is_the_map_of_the_other_outputs(result, run, recording):
    last = result.on("/cfodi/clusters")[-1].value
    first_cloud = next(bags.messages(recording("cabinet").folder(), bags.POINTS))[1]
    assert last.kind == SNAPSHOT and last.header.frame_id == "map" and not last.removed
    assert last.session_id == first_cloud and last.sequence == 58
    said = {int(c["id"]): c for c in run.clusters()}
    assert {c.id for c in last.clusters} == set(said) and len(said) == len(last.clusters)
    for cluster in last.clusters:
        other = said[cluster.id]
        assert (cluster.voxel_count, cluster.revision, cluster.state) == (
            other["voxel_count"], other["revision"], other["state"])
        assert cluster.point_count == int(other["point_count"])
        assert list(cluster.plane.coef) == other["plane"]["coef"]
        assert cluster.centroid.x == other["centroid"]["x"]
    assert last.unclustered_voxels == sum(not voxel.cluster for voxel in run.voxels().values())


def test_the_fields_of_a_cluster_fit_together(result):
    snapshots = result.on("/cfodi/clusters")
    for message in snapshots:
        for cluster in message.value.clusters:
            assert set(CLUSTER) <= set(type(cluster).__slots__)
            a, b, c, d = cluster.plane.coef
            centre, q = cluster.centroid, cluster.pose.orientation
            assert math.isclose(math.hypot(a, b, c), 1.0, abs_tol=1e-9)
            assert abs(a * centre.x + b * centre.y + c * centre.z + d) < 0.08, "the plane passes its centroid by"
            z = 2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x), 1 - 2 * (q.x * q.x + q.y * q.y)
            assert math.isclose(z[0] * a + z[1] * b + z[2] * c, 1.0, abs_tol=1e-6), "+z of the pose is the normal"
            assert math.isclose(math.hypot(q.x, q.y, q.z, q.w), 1.0, abs_tol=1e-9)
            assert cluster.size.x >= cluster.size.y >= 0 and cluster.size.z >= 0
            assert stamp_of(cluster.first_seen) <= stamp_of(cluster.last_seen) <= message.log_time
            assert cluster.point_count >= 15 * cluster.voxel_count > 0
            assert not cluster.merged_from, "a snapshot tells of no merging"


def stamp_of(time):
    return time.sec * bags.SECOND + time.nanosec


def test_deltas_alone_lead_from_the_first_snapshot_to_every_other(result):
    snapshots = [message.value for message in result.on("/cfodi/clusters")]
    deltas = [message.value for message in result.on("/cfodi/clusters_delta")]
    assert len(snapshots) >= 2 and all(delta.kind == DELTA for delta in deltas)
    assert [delta.sequence for delta in deltas] == list(range(1, 59))
    reader, waiting = MapReader(), iter(deltas)
    reader.snapshot(snapshots[0])
    for snapshot in snapshots[1:]:
        while reader.version < snapshot.sequence:
            reader.delta(next(waiting))
        rebuilt = reader.clusters
        assert set(rebuilt) == {cluster.id for cluster in snapshot.clusters}
        for cluster in snapshot.clusters:
            mine = rebuilt[cluster.id]
            different = [name for name in CLUSTER
                         if name != "merged_from" and plain(getattr(mine, name)) != plain(getattr(cluster, name))]
            assert not different, f"version {snapshot.sequence}, cluster {cluster.id}: {different}"
        assert reader.latest.unclustered_voxels == snapshot.unclustered_voxels


def test_deltas_name_what_each_cluster_was_merged_from_and_that_is_gone(result):
    deltas = [message.value for message in result.on("/cfodi/clusters_delta")]
    merged = [(delta.sequence, id, id in delta.removed) for delta in deltas for c in delta.clusters for id in c.merged_from]
    assert merged, "the recording has merges in mode `paper`"
    assert not [each for each in merged if not each[-1]]


def test_a_reader_begins_anew_with_each_lap_of_the_bag_in_a_loop(result):
    snapshots = [message.value for message in result.on("/cfodi/clusters")]
    deltas = [message.value for message in result.on("/cfodi/clusters_delta")]
    reader = MapReader()
    for _ in range(2):
        reader.snapshot(snapshots[0])
        assert reader.version == snapshots[0].sequence < snapshots[-1].sequence
        for delta in deltas:
            reader.delta(delta)
        reader.snapshot(snapshots[-1])
        assert reader.version == snapshots[-1].sequence


def test_the_labelled_points_are_the_dense_voxels(result, run):
    cloud = result.on("/cfodi/points_labelled")[-1].value
    wanted = ["x", "y", "z", "normal_x", "normal_y", "normal_z", "curvature", "label"]
    offsets = {field.name: (field.offset, field.datatype) for field in cloud.fields}
    assert set(wanted) <= set(offsets) and all(offsets[n][1] == (6 if n == "label" else 7) for n in wanted)
    assert cloud.width * cloud.height == len(run.voxels()) and len(cloud.data) == cloud.row_step * cloud.height
    at = range(offsets["label"][0], len(cloud.data), cloud.point_step)
    labels = Counter(struct.unpack_from("<I", bytes(cloud.data), offset)[0] for offset in at)
    assert labels == Counter(voxel.cluster for voxel in run.voxels().values())


def test_the_twins_are_in_it_where_they_are_asked_for_and_say_what_the_snapshots_say(result, recording, tmp_path):
    assert not {"/cfodi/detections", "/cfodi/polygons"} & set(result.schemas)
    run = Replay(recording("cabinet").folder(), tmp_path, outputs=("out",), parameters={"twins": '["detections", "polygons"]'})
    bag = ResultBag(run.path("out"))
    snapshots, detections = bag.on("/cfodi/clusters"), bag.on("/cfodi/detections")
    assert {message.type for message in detections} == {"vision_msgs/msg/Detection3DArray"}
    assert [message.log_time for message in detections] == [message.log_time for message in snapshots]
    for message, snapshot in zip(detections, snapshots):
        clusters = {str(cluster.id): cluster for cluster in snapshot.value.clusters}
        assert [detection.id for detection in message.value.detections] == list(clusters)
        for detection in message.value.detections:
            assert plain(detection.bbox.center) == plain(clusters[detection.id].pose)
    polygons = bag.on("/cfodi/polygons")
    assert {message.type for message in polygons} == {"geometry_msgs/msg/PolygonInstanceStamped"}
    of_none, *last = (message.value.polygon for message in polygons if message.log_time == snapshots[-1].log_time)
    assert of_none.id == 0 and len(of_none.polygon.points) == 0
    floor_and_ceiling = (1, 2)
    outlines = [(c.id, plain(c.boundary)) for c in snapshots[-1].value.clusters
                if c.surface_class not in floor_and_ceiling and c.boundary.points]
    assert len(outlines) > 10 and [(polygon.id, plain(polygon.polygon)) for polygon in last] == outlines
    folder = bags.convert(run.path("out"), tmp_path / "again")
    assert len(list(bags.messages(folder, "/cfodi/polygons"))) == len(polygons), "rosbags knows its definition"


def test_rosbags_reads_it_and_converts_it(result, run, tmp_path):
    folder = bags.convert(run.path("out"), tmp_path / "again")
    again = Counter(topic for topic, _, _ in bags.messages(folder))
    assert again == Counter(message.topic for message in result.messages)
    straight = [m for _, _, m in bags.messages(run.path("out"), "/cfodi/clusters")]
    mine = [m.value for m in result.on("/cfodi/clusters")]
    assert [[c.id for c in m.clusters] for m in straight] == [[c.id for c in m.clusters] for m in mine]


@pytest.mark.parametrize("compression", ["plain", "message"])
def test_with_the_input_the_input_is_in_it_too(compression, result, recording, tmp_path):
    folder = recording("cabinet").folder(compression)
    run = Replay(folder, tmp_path, "--with-input", outputs=("out",), parameters={"mode": "paper"})
    whole = ResultBag(run.path("out"))
    assert [m for m in counted(whole) if m[0] in TOPICS] == [m for m in counted(result) if m[0] in TOPICS]
    given = Counter(topic for topic, _, _ in bags.messages(folder))
    assert {topic: n for topic, n in Counter(m.topic for m in whole.messages).items() if topic not in TOPICS} == given
    info = whole.on(bags.INFO)[0].value
    assert info.k[0] > 100 and info.height > 100
    clouds = whole.on(bags.POINTS)
    assert [stamp(m.value.header) for m in clouds] == [m.log_time for m in clouds]
    first = next(m for _, _, m in bags.messages(folder, bags.POINTS))
    assert bytes(clouds[0].value.data) == first.data.tobytes()
    again = Replay(run.path("out"), tmp_path / "again", topics=[bags.POINTS], outputs=("voxels",),
                   parameters={"mode": "paper"})
    assert again.bytes("voxels") == recording("cabinet").replay().bytes("voxels")


def counted(bag):
    return [(message.topic, message.log_time) for message in bag.messages]
