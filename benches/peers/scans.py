"""The scans of a recording as one binary file that every peer reads:  python scans.py RECORDING OUT

Little-endian: `u32 scans, width, height`; then for each scan the pose, `f64[12]`, the rows of the 3x4 matrix that takes
the optical frame into the fixed one, and `f32[height * width * 3]`, its points in the optical frame in metres, row by
row, NaN where there is no depth from 0.4 to 6 m. The formulas are those of `tests/support/mod.rs`.
"""

import csv
import json
import sys
from pathlib import Path

import numpy as np

MIN_Z, MAX_Z = 0.4, 6.0


def export(recording, out):
    from PIL import Image  # here, since the peers read scans without it

    camera = json.loads((recording / "camera.json").read_text())
    width, height = camera["width"], camera["height"]
    fx, _, cx, _, fy, cy = (np.float32(k) for k in camera["K"][:6])
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    with open(recording / "poses.csv", newline="") as poses:
        rows = list(csv.DictReader(poses))
    part = out.with_suffix(".part")  # renamed when whole, so that a cut export is never read
    with open(part, "wb") as file:
        np.array([len(rows), width, height], "<u4").tofile(file)
        for row in rows:
            z = np.array(Image.open(recording / row["file"])).astype(np.float32)
            z /= np.float32(camera["depth_scale_per_m"])
            z[~((z >= MIN_Z) & (z <= MAX_Z))] = np.nan
            pose(row).astype("<f8").tofile(file)
            np.stack([(u - cx) * z / fx, (v - cy) * z / fy, z], axis=-1).astype("<f4").tofile(file)
    part.rename(out)


def pose(row):
    """The 3x4 matrix that takes the optical frame into the fixed one."""
    x, y, z, w = (float(row[name]) for name in ("qx", "qy", "qz", "qw"))
    n = 2.0 / (x * x + y * y + z * z + w * w)
    rotation = np.eye(3) - n * np.array([
        [y * y + z * z, z * w - x * y, -x * z - y * w],
        [-x * y - z * w, x * x + z * z, x * w - y * z],
        [y * w - x * z, -y * z - x * w, x * x + y * y],
    ])
    return np.column_stack([rotation, [float(row[name]) for name in ("tx", "ty", "tz")]])


def valid_points(path, count=None):
    """The valid points of the first `count` scans, or of all, each an f32 array (n, 3) in the optical frame."""
    with open(path, "rb") as file:
        scans, width, height = (int(n) for n in np.fromfile(file, "<u4", 3))
        for _ in range(min(scans, count or scans)):
            file.seek(12 * 8, 1)
            points = np.fromfile(file, "<f4", width * height * 3).reshape(-1, 3)
            yield points[~np.isnan(points[:, 2])]


if __name__ == "__main__":
    export(Path(sys.argv[1]), Path(sys.argv[2]))
