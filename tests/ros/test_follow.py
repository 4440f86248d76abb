"""The follower itself, which the tests of survival and the soak believe."""

from cfodi_msgs.msg import SurfaceCluster, SurfaceClusterArray
from follow import Follower
from geometry_msgs.msg import Point32


def message(sequence, members, base=None, removed=()):
    message = SurfaceClusterArray(session_id=1, sequence=sequence, base_sequence=sequence - 1 if base is None else base,
                                  removed=list(removed))
    for id, revision in members.items():
        message.clusters.append(SurfaceCluster(id=id, revision=revision))
        message.clusters[-1].plane.coef = [0.0, 0.0, 1.0, 0.0]
    return message


def followed(*steps):
    """A follower of snapshots (S) and deltas (D) in this order."""
    follower = Follower()
    for kind, *content in steps:
        {"S": follower.snapshot, "D": follower.delta}[kind](message(*content))
    return follower


def test_a_snapshot_is_held_against_the_deltas_that_led_to_it():
    right = followed(("S", 1, {1: 1}), ("D", 2, {2: 1}), ("S", 2, {1: 1, 2: 1}))
    assert (right.compared, right.gaps, right.violations) == (1, 0, [])
    wrong = followed(("S", 1, {1: 1}), ("D", 2, {2: 1}), ("S", 2, {2: 1}))
    assert wrong.compared == 1 and "[1]" in wrong.violations[0]


def test_what_is_merged_is_counted_and_must_be_gone():
    for removed, merges, violations in (([2, 3], 2, 0), ([2], 2, 1)):
        follower = followed(("S", 1, {1: 1, 2: 1, 3: 1}))
        merged = message(2, {1: 2}, removed=removed)
        merged.clusters[0].merged_from = [2, 3]
        follower.delta(merged)
        assert (follower.merges, len(follower.violations)) == (merges, violations), follower.violations


def test_after_a_gap_it_goes_on_from_a_snapshot_that_covers_it_and_has_counted_one():
    """The network was joined anew: the latched snapshot is older than the first delta that arrives."""
    follower = followed(("S", 1, {1: 1}), ("D", 5, {1: 5}), ("S", 3, {1: 3}), ("D", 6, {1: 6}), ("S", 6, {1: 6}),
                        ("D", 7, {2: 1}), ("S", 7, {1: 6, 2: 1}))
    assert (follower.gaps, follower.compared, follower.violations) == (1, 1, [])


def test_an_area_is_that_of_its_outline():
    def violations(area):
        square = message(1, {1: 1})
        square.clusters[0].area = area
        square.clusters[0].boundary.points = [Point32(x=float(x), y=float(y)) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
        follower = Follower()
        follower.snapshot(square)
        return follower.violations

    assert not violations(1.0)
    assert all("area" in violations(wrong)[0] for wrong in (0.99, 1.01, 2.0))


def test_two_gaps_are_two():
    follower = followed(("S", 1, {1: 1}), ("D", 3, {1: 3}), ("S", 3, {1: 3}), ("D", 4, {1: 4}), ("D", 6, {1: 6}))
    assert follower.gaps == 2
