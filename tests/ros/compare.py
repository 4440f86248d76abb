"""What a reader knows after a run, held against what the node said of itself."""

from collections import Counter

import numpy as np
from map_reader import MapReader
from peer import stamp
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


def markers_agree(snapshot, message, max_points=100_000, max_cubes=20_000):
    """Each cluster has a surface that bears its id and covers its boundary less its holes, and their edges; voxels in
    no cluster are cubes. So within the bounds; beyond them, what is shown keeps to them."""
    shown = [m for m in message.markers if m.action == Marker.ADD]
    assert len({(m.ns, m.id) for m in message.markers}) == len(message.markers), "two markers with one identity"
    surfaces = {int(m.text): m for m in shown if m.ns == "surfaces"}
    outlines = {m.id: m for m in shown if m.ns == "outlines"}
    unclustered = sum(len(m.points) for m in shown if m.ns == "unclustered")
    assert all(m.type == Marker.TRIANGLE_LIST for m in surfaces.values())
    assert unclustered == min(snapshot.unclustered_voxels, max_cubes)
    points = sum(len(m.points) for m in [*surfaces.values(), *outlines.values()])
    clusters = {cluster.id: cluster for cluster in snapshot.clusters}
    assert surfaces.keys() <= clusters.keys() and points <= max_points
    if points < 0.9 * max_points:
        assert surfaces.keys() == clusters.keys()
    for i, surface in surfaces.items():
        rings = [clusters[i].boundary.points, *(hole.points for hole in clusters[i].holes)]
        assert len(outlines[surface.id].points) == 2 * sum(map(len, rings))
        corners = positions(surface.points).reshape(-1, 3, 3)
        doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        covered = np.linalg.norm(doubled, axis=1).sum() / 2
        # Holes turn the other way and take away; outlines are rounded to 32 bits.
        enclosed = np.linalg.norm(sum(turned_area(positions(ring)) for ring in rings))
        assert abs(covered - enclosed) < 1e-3 * enclosed + 1e-6, f"cluster {i}: {covered} of {enclosed} m^2"


def positions(points):
    return np.array([(p.x, p.y, p.z) for p in points])


def turned_area(ring):
    """The area that a plane ring encloses, along its normal."""
    ring = ring - ring[0]
    return np.cross(ring, np.roll(ring, -1, axis=0)).sum(0) / 2
