"""A reader that follows a map for hours and holds every message against what the interface promises."""

import struct

import numpy as np
from rclpy.serialization import serialize_message

UNIT, AREA = 1e-6, 1e-4  # how far a normal's length and an area (with its share of 1 m^2) may be off


class Follower:
    """Feed it each message as it comes. `violations` says what was wrong, `compared` how many snapshots were held against
    the map that the deltas made, `merges` how many clusters were merged into others, `gaps` how often a delta was missing, so that it
    went on from a snapshot."""

    def __init__(self):
        self.violations, self.compared, self.merges, self.gaps, self.sessions = [], 0, 0, 0, 0
        self.session = self.version = None
        self._clusters = {}  # id -> the cluster, packed
        self._revisions, self._gone, self._ahead = {}, set(), {}
        self._heard = 0  # sequence of the newest delta that came while there was no snapshot to begin from

    def delta(self, message):
        if not self._in_session(message):
            return
        if self.version is None:
            self._heard = max(self._heard, message.sequence)
        if self.version is None or message.sequence <= self.version:
            return
        where = f"delta {message.sequence}"
        self._hold(message.sequence == message.base_sequence + 1, f"{where}: its base is {message.base_sequence}")
        self._hold(not message.clusters or len({c.id for c in message.clusters}) == len(message.clusters),
                   f"{where}: an id twice")
        if message.base_sequence != self.version:
            self._gap(message)
            return
        for gone in message.removed:
            self._hold(self._clusters.pop(gone, None) is not None, f"{where}: {gone} is gone and was not there")
            self._gone.add(gone)
        for cluster in message.clusters:
            self._cluster(cluster, where)
        for cluster in message.clusters:
            left = [i for i in cluster.merged_from if i in self._clusters]
            self._hold(not left, f"{where}: {left} were merged into {cluster.id} and are still there")
            self.merges += len(cluster.merged_from)
            cluster.merged_from = []
            self._clusters[cluster.id] = packed(cluster)
        self.version = message.sequence
        if ahead := self._ahead.pop(self.version, None):
            self._compare(ahead)

    def snapshot(self, message):
        if not self._in_session(message):
            return
        if self.version is None and message.sequence < self._heard:
            return  # the deltas from it to those that came are missing
        if self.version is None:
            self._begin(message)
        elif message.sequence == self.version:
            self._compare(message)
        elif message.sequence > self.version:
            self._ahead[message.sequence] = message

    def _in_session(self, message):
        """Messages of a session that is over may still be on their way."""
        if self.session is not None and message.session_id < self.session:
            return False
        if message.session_id != self.session:
            self.session, self.version, self.sessions = message.session_id, None, self.sessions + 1
            self._clusters, self._revisions, self._gone, self._ahead, self._heard = {}, {}, set(), {}, 0
        return True

    def _gap(self, message):
        """Goes on from the newest snapshot that has come, where it covers what is missing, or waits for one that does."""
        self.gaps += 1
        self.version, ahead, self._ahead = None, self._ahead, {}
        if max(ahead, default=-1) >= message.base_sequence:
            self._begin(ahead[max(ahead)])
        self.delta(message)

    def _begin(self, snapshot):
        where = f"snapshot {snapshot.sequence}"
        before = set(self._clusters)
        self._clusters = {}
        for cluster in snapshot.clusters:
            self._cluster(cluster, where)
            self._clusters[cluster.id] = packed(cluster)
        self._gone |= before - set(self._clusters)
        self.version = snapshot.sequence

    def _compare(self, snapshot):
        said = {cluster.id: packed(cluster) for cluster in snapshot.clusters}
        where = f"snapshot {snapshot.sequence}"
        self._hold(len(said) == len(snapshot.clusters), f"{where}: an id twice")
        wrong = [i for i in said.keys() | self._clusters.keys() if said.get(i) != self._clusters.get(i)]
        self._hold(not wrong, f"{where}: clusters {sorted(wrong)[:5]} are not those of the deltas")
        self.compared += 1
        for old in [version for version in self._ahead if version < snapshot.sequence]:
            del self._ahead[old]

    def _cluster(self, cluster, where):
        where = f"{where}, cluster {cluster.id}"
        self._hold(cluster.id > 0 and cluster.id not in self._gone, f"{where}: an id that is used up")
        self._hold(cluster.revision >= self._revisions.get(cluster.id, 0), f"{where}: its revision goes back")
        self._revisions[cluster.id] = cluster.revision
        normal = np.array(cluster.plane.coef[:3])
        self._hold(abs(np.linalg.norm(normal) - 1) < UNIT, f"{where}: a normal of length {np.linalg.norm(normal)}")
        if cluster.boundary.points:
            holes = [turned(hole, normal) for hole in cluster.holes]
            area = turned(cluster.boundary, normal) + sum(holes)
            fits = abs(area - cluster.area) <= AREA * (1 + cluster.area) and max(holes, default=0) <= 0
            self._hold(fits, f"{where}: its area is {cluster.area}, its outline's {area}")

    def _hold(self, true, what):
        if not true:
            self.violations.append(what)


def packed(cluster):
    """A cluster that names none it was merged from, as bytes that are equal where its fields are: without the two gaps
    that CDR leaves before class_confidence and point_count, where anything may stand."""
    data = serialize_message(cluster)
    return data[:18] + data[20:336] + data[340:]


def turned(polygon, normal):
    """The area of a polygon, negative where it goes clockwise about the normal."""
    points = np.array([(p.x, p.y, p.z) for p in polygon.points])
    points = points - points[0]
    return 0.5 * float(np.cross(points, np.roll(points, -1, 0)).sum(0) @ normal)


def stamp_of(raw):
    """The stamp (ns) of a serialised message that begins with a header."""
    seconds, nanoseconds = struct.unpack_from("<iI", raw, 4)
    return seconds * 10**9 + nanoseconds


def follow(snapshots, deltas):
    """A follower of two recordings, fed in the order in which their messages came."""
    follower = Follower()
    messages = [(at, i, follower.snapshot, snapshots) for i, (at, _) in enumerate(snapshots.raw)]
    messages += [(at, i, follower.delta, deltas) for i, (at, _) in enumerate(deltas.raw)]
    for _, i, take, recording in sorted(messages, key=lambda message: message[0]):
        take(recording[i])
    return follower
