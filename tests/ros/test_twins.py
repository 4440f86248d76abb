"""The clusters in messages of others, beside our own."""

import time

import compare
import numpy as np
import pytest
import scene
from cfodi_msgs.msg import SurfaceCluster
from geometry_msgs.msg import Polygon, PolygonInstanceStamped
from peer import qos, wait_until
from vision_msgs.msg import Detection3DArray

BOTH = '["detections", "polygons"]'
NAMES = ["unknown", "floor", "ceiling", "wall", "horizontal", "slope", "curved", "door"]
OF_NONE = 0  # id of the polygon without points that each map has
NO_OBSTACLE = (SurfaceCluster.CLASS_FLOOR, SurfaceCluster.CLASS_CEILING)


def seen(start, peer, parameters, cloud=None):
    """The last snapshot of a node that has seen the room or such a cloud, and recordings of both twins."""
    start(parameters).ready()
    peer.record_node()
    detections = peer.record("/cfodi/detections", Detection3DArray, qos(100, latched=True))
    polygons = peer.record("/cfodi/polygons", PolygonInstanceStamped, qos(1000))
    camera = peer.camera()
    camera.meet()
    last = scene.show(camera, peer.deltas, cloud or scene.room())
    snapshot = peer.clusters.wait("the snapshot of the last scan", lambda m: compare.stamp(m) == last)
    return snapshot, detections, polygons


def of_stamp(recording, snapshot):
    return [message for message in recording if compare.stamp(message) == compare.stamp(snapshot)]


def test_both_say_what_the_snapshot_of_their_stamp_says(start, peer):
    snapshot, detections, polygons = seen(start, peer, {"twins": BOTH})
    classes = {cluster.surface_class for cluster in snapshot.clusters}
    assert {SurfaceCluster.CLASS_FLOOR, SurfaceCluster.CLASS_WALL, SurfaceCluster.CLASS_HORIZONTAL} <= classes
    twin = detections.wait("its detections", lambda m: compare.stamp(m) == compare.stamp(snapshot))
    assert twin.header == snapshot.header
    assert len(twin.detections) == len(snapshot.clusters)
    for cluster, detection in zip(snapshot.clusters, twin.detections):
        assert_is_the_cluster(detection, cluster, snapshot.header)
    outlines = {c.id: c.boundary for c in snapshot.clusters if c.surface_class not in NO_OBSTACLE and c.boundary.points}
    assert len(outlines) >= 2
    wait_until("its polygons", lambda: {p.polygon.id for p in of_stamp(polygons, snapshot)} >= set(outlines))
    time.sleep(1.5)  # three periods of publish_rate
    assert len(of_stamp(polygons, snapshot)) == len(outlines) + 1, "an old map, sent again, is a free way to nav2 for a moment"
    for polygon in of_stamp(polygons, snapshot):
        assert polygon.header == snapshot.header
        assert polygon.polygon.polygon == (outlines | {OF_NONE: Polygon()})[polygon.polygon.id]


def assert_is_the_cluster(detection, cluster, header):
    assert (detection.header, detection.id) == (header, str(cluster.id))
    assert (detection.bbox.center, detection.bbox.size) == (cluster.pose, cluster.size)
    (result,) = detection.results
    assert result.hypothesis.class_id == NAMES[cluster.surface_class]
    assert result.hypothesis.score == cluster.class_confidence
    assert result.pose.pose == cluster.pose
    covariance = np.array(result.pose.covariance).reshape(6, 6)
    plane = np.array(cluster.plane_covariance).reshape(3, 3)
    axes = rotation(cluster.pose.orientation)
    x, y, z = axes.T
    lift = np.zeros((6, 3))
    lift[:3, 2], lift[3:, 0], lift[3:, 1] = z, x, y
    np.testing.assert_allclose(covariance, lift @ plane @ lift.T, rtol=1e-9, atol=1e-15)


def rotation(q):
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def test_who_comes_late_has_the_detections_at_once(start, peer):
    start({"twins": BOTH, "publish_rate": 0.01}).ready()
    latched = peer.record("/cfodi/detections", Detection3DArray, qos(1, latched=True))
    assert not latched.wait("those of the empty map, of which the next go out in 100 s").detections


def test_who_reads_as_nav2_does_has_the_polygons_of_all_clusters(start, peer):
    """Its collision monitor has a best-effort reader of depth 5, keeps one polygon an id, and stops where it has none."""
    seen(start, peer, {"twins": BOTH}, scene.panels())
    polygons = peer.record("/cfodi/polygons", PolygonInstanceStamped, qos(5, reliable=False))
    camera = peer.camera()
    camera.meet()

    def has_all_of_a_map():
        last = scene.show(camera, peer.deltas, scene.panels())
        snapshot = peer.clusters.wait("the snapshot of the last scan", lambda m: compare.stamp(m) == last)
        time.sleep(0.5)  # over which they go out
        outlined = {cluster.id for cluster in snapshot.clusters if cluster.boundary.points}
        assert len(outlined) >= 20
        return {p.polygon.id for p in of_stamp(polygons, snapshot)} == outlined | {OF_NONE}

    wait_until("the polygons of all clusters", has_all_of_a_map, timeout=120)


def test_the_letter_knows_no_classes_and_no_covariance(start, peer):
    snapshot, detections, _ = seen(start, peer, {"mode": "paper", "twins": '["detections"]'})
    twin = detections.wait("its detections", lambda m: compare.stamp(m) == compare.stamp(snapshot))
    assert [d.id for d in twin.detections] == [str(c.id) for c in snapshot.clusters] != []
    results = [result for detection in twin.detections for result in detection.results]
    assert {(r.hypothesis.class_id, r.hypothesis.score, *set(r.pose.covariance)) for r in results} == {("unknown", 0.0, 0.0)}


def test_nobody_is_sent_a_twin_who_has_not_asked_for_it(start, peer):
    start({"twins": '["polygons"]'}).ready()
    wait_until("~/polygons", lambda: peer.node.count_publishers("/cfodi/polygons"))
    assert peer.node.count_publishers("/cfodi/detections") == 0


@pytest.mark.parametrize("parameters, words", [
    ({"twins": '["detection"]'}, 'twins is ["detection"]; it must be out of `detections` and `polygons`; the nearest'),
    ({"twins": '["polygons"]', "mode": "paper"}, "without `polygons` where mode is `paper`"),
])
def test_a_twin_that_cannot_be_ends_the_node_with_status_2(parameters, words, start):
    node = start(parameters)
    assert node.wait() == 2
    assert any(words in line for line in node.lines), node.lines
