"""The voxels of a bag, counted a second time with numpy, from the paper's words: no code is shared with the product."""

from collections import defaultdict

import bags
import numpy as np
from scipy.spatial.transform import Rotation, Slerp


class Transforms:
    """All transforms of a bag; between two stamps the translation is interpolated linearly, the rotation by slerp."""

    def __init__(self, bag):
        found = defaultdict(list)
        for topic, _, message in bags.messages(bag, "/tf", "/tf_static"):
            for one in message.transforms:
                t, q = one.transform.translation, one.transform.rotation
                pose = [t.x, t.y, t.z], [q.x, q.y, q.z, q.w]
                child, parent = one.child_frame_id.lstrip("/"), one.header.frame_id.lstrip("/")
                found[child].append((nanoseconds(one.header.stamp), parent, topic == "/tf_static", *pose))
        self._ways = {child: way(sorted(samples)) for child, samples in found.items()}

    def to_root(self, frame, stamp):
        """(rotation matrix, translation, root) that map points of `frame` at `stamp` into the root; None where a
        transform on the way does not cover the stamp."""
        rotation, translation, frame = np.eye(3), np.zeros(3), frame.lstrip("/")
        while frame in self._ways:
            parent, at = self._ways[frame]
            if (step := at(stamp)) is None:
                return None
            rotation, translation, frame = step[0] @ rotation, step[0] @ translation + step[1], parent
        return rotation, translation, frame


def way(samples):
    """(parent, function of the stamp) of one child's samples."""
    stamps = np.array([sample[0] for sample in samples])
    moves = np.array([sample[3] for sample in samples])
    turns = Rotation.from_quat([sample[4] for sample in samples])
    if samples[0][2] or len(samples) == 1:
        fixed = turns[-1].as_matrix(), moves[-1]
        covers = (lambda stamp: True) if samples[0][2] else (lambda stamp: stamp == stamps[0])
        return samples[0][1], lambda stamp: fixed if covers(stamp) else None
    seconds = (stamps - stamps[0]) / 1e9
    turn = Slerp(seconds, turns)

    def at(stamp):
        if not stamps[0] <= stamp <= stamps[-1]:
            return None
        now = (stamp - int(stamps[0])) / 1e9
        return turn(now).as_matrix(), np.array([np.interp(now, seconds, moves[:, axis]) for axis in range(3)])

    return samples[0][1], at


def nanoseconds(stamp):
    return stamp.sec * bags.SECOND + stamp.nanosec


def scans(bag, *topics, millimetres=False):
    """(stamp, frame, all points in the sensor's frame [m], float64) of each cloud, in the order of the stamps."""
    for _, _, message in bags.messages(bag, *topics):
        floats = message.data.view(np.float32).reshape(-1, message.point_step // 4)
        assert [(f.name, f.offset) for f in message.fields][:3] == [("x", 0), ("y", 4), ("z", 8)]
        points = floats[:, :3]
        if millimetres:  # what a 16UC1 image keeps of it
            z = points[:, 2].copy()
            rounded = np.round(z * np.float32(1000)) / np.float32(1000)
            points = points * (rounded / z)[:, None]
            points[:, 2] = rounded
        yield nanoseconds(message.header.stamp), message.header.frame_id, points.astype(np.float64)


class Voxels:
    """Number and sum of the points of each voxel, over all scans that have a transform."""

    def __init__(self, bag, *topics, voxel_size=0.08, ranges=(0.4, 6.0), first=None, millimetres=False):
        self.points = self.finite = self.valid = self.scans = self.skipped = 0
        self.count, self.sum = {}, {}
        transforms = Transforms(bag)
        for stamp, frame, points in list_first(scans(bag, *topics, millimetres=millimetres), first):
            if (found := transforms.to_root(frame, stamp)) is None:
                self.skipped += 1
                continue
            rotation, translation, self.root = found
            finite = np.isfinite(points).all(axis=1)
            z = np.where(finite, points[:, 2], 0.0)
            inside = finite & (ranges[0] <= z) & (z <= ranges[1])
            self.scans += 1
            self.points += len(points)
            self.finite += int(finite.sum())
            self.valid += int(inside.sum())
            self._add(points[inside] @ rotation.T + translation, voxel_size)

    def _add(self, points, voxel_size):
        keys, place, counts = np.unique(np.floor(points / voxel_size).astype(np.int64), axis=0, return_inverse=True,
                                        return_counts=True)
        sums = np.stack([np.bincount(place.ravel(), weights=points[:, axis]) for axis in range(3)], axis=1)
        for key, count, total in zip(map(tuple, keys.tolist()), counts.tolist(), sums):
            self.count[key] = self.count.get(key, 0) + count
            self.sum[key] = self.sum.get(key, 0) + total

    def dense(self, min_points=15):
        return {key: count for key, count in self.count.items() if count >= min_points}


def list_first(items, count):
    for number, item in enumerate(items):
        if number == count:
            return
        yield item


def moved_points(said, counted, min_points=15):
    """The least number of points that would have to change their voxel to make V.csv of what was counted."""
    differing = sum(abs(voxel.count - counted.count.get(key, 0)) for key, voxel in said.items())
    missing = sum(count - min_points + 1 for key, count in counted.dense(min_points).items() if key not in said)
    return differing + missing


def assert_same_voxels(said, counted, allowed=1e-5):
    """V.csv holds the voxels that numpy counts, but for points at a border: at most a share of `allowed`."""
    moved = moved_points(said, counted)
    keys = set(said) ^ set(counted.dense())
    print(f"{len(said)} dense voxels, {len(keys)} of them in one only; {moved} of {counted.valid} points differ")
    assert counted.valid and moved <= allowed * counted.valid
    apart = [np.abs(np.array(voxel.centre) - counted.sum[key] / voxel.count).max()
             for key, voxel in said.items() if counted.count.get(key) == voxel.count]
    print(f"centres of {len(apart)} voxels with equal counts: at most {max(apart):.2e} m apart")
    assert len(apart) >= 0.99 * len(said) and max(apart) < 1e-6
