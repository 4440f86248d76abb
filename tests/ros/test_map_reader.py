"""The readers in examples/, which planners copy."""

import pathlib

import cpp
from cfodi_msgs.msg import SurfaceCluster, SurfaceClusterArray

from map_reader import MapReader

HERE = pathlib.Path(__file__).resolve().parent


def message(session, sequence, members, removed=(), second=0):
    array = SurfaceClusterArray(
        session_id=session, sequence=sequence, base_sequence=max(sequence - 1, 0), removed=list(removed),
        clusters=[SurfaceCluster(id=id, revision=revision) for id, revision in members.items()])
    array.header.stamp.sec = second
    return array


def holds(reader):
    return reader.version, {id: cluster.revision for id, cluster in reader.clusters.items()}


def test_deltas_wait_for_a_snapshot_and_those_up_to_its_version_are_dropped():
    reader = MapReader()
    reader.delta(message(1, 2, {1: 2}))
    reader.delta(message(1, 3, {3: 1}, removed=[2]))
    assert holds(reader) == (None, {})
    reader.snapshot(message(1, 2, {1: 2, 2: 1}))
    assert holds(reader) == (3, {1: 2, 3: 1})


def test_a_snapshot_that_is_older_than_the_map_changes_nothing():
    reader = MapReader()
    reader.snapshot(message(1, 2, {1: 2}))
    reader.delta(message(1, 3, {1: 3}))
    reader.snapshot(message(1, 2, {1: 2}))
    assert holds(reader) == (3, {1: 3})


def test_on_a_gap_the_reader_waits_and_goes_on_from_the_next_snapshot():
    reader = MapReader()
    reader.snapshot(message(1, 1, {1: 1}))
    reader.delta(message(1, 4, {4: 1}))
    assert holds(reader) == (1, {1: 1})
    reader.snapshot(message(1, 3, {1: 3}))
    assert holds(reader) == (4, {1: 3, 4: 1})


def test_a_new_session_begins_a_new_map():
    reader = MapReader()
    reader.snapshot(message(1, 7, {1: 7}))
    reader.delta(message(2, 1, {1: 1}))
    assert holds(reader) == (7, {1: 7})
    reader.snapshot(message(2, 0, {}))
    assert holds(reader) == (1, {1: 1})


def test_a_recording_that_is_played_again_begins_a_new_map_though_its_session_is_the_same():
    reader = MapReader()
    reader.snapshot(message(1, 1, {1: 1}, second=100))
    reader.snapshot(message(1, 60, {1: 60}, second=102))
    reader.delta(message(1, 61, {1: 61}, second=103))
    reader.delta(message(1, 64, {1: 64}, second=104))
    assert holds(reader) == (61, {1: 61})
    reader.snapshot(message(1, 1, {1: 1}, second=100))
    reader.delta(message(1, 2, {2: 1}, second=101))
    assert holds(reader) == (2, {1: 1, 2: 1})
    reader.snapshot(message(1, 63, {1: 63}, second=103))
    assert holds(reader) == (63, {1: 63})


def test_a_snapshot_that_is_late_or_comes_again_is_no_recording_however_seldom_they_are():
    reader = MapReader()
    reader.snapshot(message(1, 1, {1: 1}, second=100))
    for sequence in range(2, 5):
        reader.delta(message(1, sequence, {1: sequence}, second=100 + 10 * sequence))
    for sequence, second in (1, 100), (3, 130), (3, 130):
        reader.snapshot(message(1, sequence, {1: sequence}, second=second))
        assert holds(reader) == (4, {1: 4})
    reader.snapshot(message(1, 2, {1: 2}, second=140))
    assert holds(reader) == (4, {1: 4})


def test_the_reader_in_cpp_compiles_against_the_generated_headers_and_does_the_same(tmp_path):
    cpp.run(HERE / "map_reader_test.cpp", tmp_path)
