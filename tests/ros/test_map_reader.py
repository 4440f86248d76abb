"""The readers in examples/, which planners copy."""

import pathlib

import cpp
from cfodi_msgs.msg import SurfaceCluster, SurfaceClusterArray

from map_reader import MapReader

HERE = pathlib.Path(__file__).resolve().parent


def message(session, sequence, members, removed=()):
    return SurfaceClusterArray(
        session_id=session, sequence=sequence, base_sequence=max(sequence - 1, 0), removed=list(removed),
        clusters=[SurfaceCluster(id=id, revision=revision) for id, revision in members.items()])


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


def test_the_reader_in_cpp_compiles_against_the_generated_headers_and_does_the_same(tmp_path):
    cpp.run(HERE / "map_reader_test.cpp", tmp_path)
