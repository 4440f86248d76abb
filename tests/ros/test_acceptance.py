"""The values of the paper's mode on a real recording, seen from outside."""

import compare
import pytest
from peer import until_taken_in

FIRST_STAMP, PERIOD = 1_700_000_000 * 10**9, 33_333_333


def assert_within_half_a_percent(what, found, expected):
    assert abs(found - expected) <= 0.005 * expected, f"{what}: {found}, expected {expected}"


@pytest.mark.parametrize("min_vicinity, clusters, of_10_voxels", [(1, 292, 32), (3, 758, 30)])
def test_the_cabinet_gives_the_accepted_counts(min_vicinity, clusters, of_10_voxels, recordings, large_buffers, start, peer):
    import clouds
    start({"mode": "paper", "min_vicinity": min_vicinity}).ready()
    peer.record_node()
    camera = peer.camera()
    camera.meet()
    scans = 0
    for scan in clouds.cabinet(recordings):
        # The next one must not replace it, and best effort may lose one.
        stamp = FIRST_STAMP + scans * PERIOD
        until_taken_in(lambda: camera.publish(scan.cloud, stamp, scan.transform), peer.deltas, seconds=8, attempts=3)
        scans += 1
    assert scans == 58
    snapshot = peer.clusters.wait("the snapshot of the last scan", lambda m: m.sequence == scans)
    points = peer.labelled.wait("its points", lambda m: compare.stamp(m) == compare.stamp(snapshot))
    compare.labels_agree(snapshot, points)
    sizes = [cluster.voxel_count for cluster in snapshot.clusters]
    print(points.width * points.height, len(sizes), sum(size >= 10 for size in sizes))
    assert_within_half_a_percent("dense voxels", points.width * points.height, 14_342)
    assert_within_half_a_percent("clusters", len(sizes), clusters)
    assert_within_half_a_percent("clusters of 10 voxels or more", sum(size >= 10 for size in sizes), of_10_voxels)
