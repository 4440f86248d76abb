"""What a reader knows after a run, held against what the node said of itself."""

from collections import Counter

import numpy as np
from map_reader import MapReader
from visualization_msgs.msg import Marker

# Fields of ~/points_labelled: (numpy type, name), all of 4 bytes.
LABELLED = [("<f4", "x"), ("<f4", "y"), ("<f4", "z"), ("<f4", "normal_x"), ("<f4", "normal_y"), ("<f4", "normal_z"),
            ("<f4", "curvature"), ("<u4", "label")]
POINT_FIELD = {"<f4": 7, "<u4": 6}


def plain(value):
    """A message as nested tuples and numbers that can be compared; NaN equals NaN. `merged_from` tells of one message,
    not of the map, and is left out."""
    if hasattr(value, "get_fields_and_field_types"):
        return tuple(plain(getattr(value, f)) for f in value.get_fields_and_field_types() if f != "merged_from")
    if hasattr(value, "__len__") and not isinstance(value, str):
        return tuple(map(plain, value))
    return "NaN" if value != value else value


def stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def whole(message):
    """The map that a snapshot holds."""
    return map_of(message.clusters, message)


def map_of(clusters, latest):
    return {"stamp": stamp(latest), "frame": latest.header.frame_id, "session": latest.session_id,
            "version": latest.sequence, "unclustered": latest.unclustered_voxels,
            "clusters": {cluster.id: plain(cluster) for cluster in clusters}}


def rebuilds_every_snapshot(snapshots, deltas):
    """Feeds a reader with the first snapshot and then with deltas alone; each later snapshot must be the map it has by
    then. Returns how many snapshots were held against it."""
    reader, compared, waiting = MapReader(), 0, iter(deltas)
    reader.snapshot(snapshots[0])
    for snapshot in snapshots[1:]:
        while reader.version < snapshot.sequence:
            delta = next(waiting, None)
            assert delta is not None, f"no deltas lead from version {reader.version} to {snapshot.sequence}"
            reader.delta(delta)
        assert reader.version == snapshot.sequence
        rebuilt, said = map_of(reader.clusters.values(), reader.latest), whole(snapshot)
        wrong = [i for i in rebuilt["clusters"].keys() | said["clusters"].keys()
                 if rebuilt["clusters"].get(i) != said["clusters"].get(i)]
        assert not wrong, f"version {snapshot.sequence}: clusters {sorted(wrong)[:10]} differ"
        assert rebuilt == said
        compared += 1
    return compared


def by_stamp(messages):
    return {stamp(message): message for message in messages}


def labelled_points(message):
    """~/points_labelled as a structured array."""
    described = [(f.name, f.offset, f.datatype, f.count) for f in message.fields]
    named = {name: kind for kind, name in LABELLED}
    assert {name: kind for name, _, kind, _ in described} == {n: POINT_FIELD[k] for n, k in named.items()}
    assert not message.is_bigendian and len(message.data) == message.row_step * message.height
    kinds = np.dtype({"names": [d[0] for d in described], "formats": [named[d[0]] for d in described],
                      "offsets": [d[1] for d in described], "itemsize": message.point_step})
    return np.frombuffer(bytes(message.data), kinds)


def labels_agree(snapshot, message):
    """Every dense voxel is in the labelled cloud once, under its cluster's id or 0."""
    count = Counter(labelled_points(message)["label"].tolist())
    said = {cluster.id: cluster.voxel_count for cluster in snapshot.clusters}
    if snapshot.unclustered_voxels:
        said[0] = snapshot.unclustered_voxels
    assert count == said


def markers_agree(snapshot, message, cap):
    """Each cluster has a cube list that bears its id and holds its voxels; all lists together hold at most `cap` cubes."""
    cubes = [m for m in message.markers if m.ns == "clusters" and m.action == Marker.ADD]
    assert all(m.type == Marker.CUBE_LIST for m in cubes)
    assert len({m.id for m in cubes}) == len(cubes), "two markers with one identity"
    shown = {int(m.text): len(m.points) for m in cubes}
    voxels = {cluster.id: cluster.voxel_count for cluster in snapshot.clusters}
    if sum(voxels.values()) + snapshot.unclustered_voxels <= cap:
        assert shown == voxels
    else:
        assert sum(shown.values()) <= cap and all(shown[i] <= voxels[i] for i in shown)
