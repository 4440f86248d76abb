"""Scenes that are small enough for any socket buffer, before a camera 1 m up that stands still (`clouds.still_transform`: the
map's x is ahead, z up). The room has a floor, a wall 3 m ahead and a table."""

import time

import clouds
import numpy as np
from peer import until_taken_in

STEP = 0.03  # points of one scan are sparse: some scans make a voxel dense
TABLE = {"height": 0.5, "from": 1.5, "to": 2.1, "side": 0.45}
WALL = 3.0
SCANS = 8


def grid(first, last):
    return np.arange(first, last, STEP)


def level(height, near, far, side):
    """Points of a level surface, in optical axes."""
    z, x = np.meshgrid(grid(near, far), grid(-side, side))
    return np.stack([x.ravel(), np.full(x.size, 1.0 - height), z.ravel()], axis=-1)


def panels():
    """25 upright panels beside each other, at several distances, serialised."""
    points = []
    for column in range(5):
        for row in range(5):
            left, top, away = 0.5 * column - 1.2, 0.4 * row - 0.9, 2.5 + 0.15 * ((column + 2 * row) % 4)
            x, y = np.meshgrid(grid(left, left + 0.32), grid(top, top + 0.26))
            points.append(np.stack([x.ravel(), y.ravel(), np.full(x.size, away)], axis=-1))
    return padded_cloud(np.concatenate(points))


def padded_cloud(points):
    padded = np.zeros((1, len(points), 4), np.float32)
    padded[0, :, :3] = points
    return clouds.cloud(padded)


def room():
    """The points that the camera sees, serialised: what the table hides is not among them."""
    y, x = np.meshgrid(grid(-0.8, 1.0), grid(-1.2, 1.2))
    wall = np.stack([x.ravel(), y.ravel(), np.full(x.size, WALL)], axis=-1)
    drop = 1.0 - TABLE["height"]
    # Where its ray goes through the table's plane.
    at = wall * (drop / np.maximum(wall[:, 1:2], 1e-9))
    margin = 0.05
    hidden = ((wall[:, 1] > drop) & (np.abs(at[:, 0]) < TABLE["side"] + margin)
              & (at[:, 2] > TABLE["from"] - margin) & (at[:, 2] < TABLE["to"] + margin))
    return padded_cloud(np.concatenate([wall[~hidden], level(0.0, 1.0, WALL, 1.2),
                                        level(TABLE["height"], TABLE["from"], TABLE["to"], TABLE["side"])]))


def show(camera, deltas, cloud):
    """Sends such a cloud until its voxels are dense; returns the stamp of the last scan."""
    first_stamp, transform = time.time_ns(), clouds.still_transform()
    for number in range(SCANS):
        stamp = first_stamp + number * 33_333_333
        until_taken_in(lambda: camera.publish(cloud, stamp, transform), deltas)
    return stamp
