"""The stream clustering methods that CFODI's paper names, point by point:  python streams.py SCANS SECONDS

Each is given the points of the first scan, in order, for SECONDS at most; what is timed is taking points in, not asking
for clusters. Cells, radii and thresholds are those of ours at 8 cm, and what fades has half its weight after one scan,
where the method allows that: with their defaults most of them forget a scan's begin before its end, and are the faster
for it. The points are laid out as each library wants them before the clock starts.
"""

import importlib.util
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scans import valid_points

VOXEL_SIZE = 0.08
MIN_POINTS = 15
CHUNK = 100  # points between two looks at the clock
TICK = 100  # points to a tick of DenStream's clock, the default of both implementations


class Method(NamedTuple):
    name: str
    take: Callable[[Sequence], Any]  # a chunk of `points`
    points: Sequence
    settings: str
    kept: Callable[[], str]  # what it holds at the end


def main(scans, seconds):
    points = next(valid_points(scans, 1)).astype(np.float64)
    print(f"scan_points {len(points)}")
    for library, methods in (("river", river), ("MOA in capymoa", moa), ("incdbscan", incdbscan)):
        try:
            for method in methods(points):
                measure(method, seconds)
        except Exception as error:  # whatever stops one library, the next is measured
            reason = (str(error).splitlines() or [""])[0]
            print(f"missing {library}: {type(error).__name__}: {reason}", flush=True)


def measure(method, seconds):
    taken, elapsed, begin = 0, 0.0, time.perf_counter()
    while elapsed < seconds and taken < len(method.points):
        chunk = method.points[taken : taken + CHUNK]
        method.take(chunk)
        taken += len(chunk)
        elapsed = time.perf_counter() - begin
    print(f"stream {method.name} | {taken / elapsed:.0f} | {taken} | {method.kept()} | {method.settings}", flush=True)


def river(points):
    from river import cluster

    data = [dict(enumerate(point)) for point in points.tolist()]
    fading = TICK / len(points)
    dense = cluster.DenStream(
        decaying_factor=fading, beta=0.2, mu=MIN_POINTS, epsilon=VOXEL_SIZE, stream_speed=TICK)
    # Its radius comes out too small, often 0, away from the origin, so few micro-clusters swallow all.
    yield Method("DenStream, river", one_by_one(dense.learn_one), data, f"epsilon {VOXEL_SIZE} m, mu {MIN_POINTS}",
                 lambda: f"{len(dense.p_micro_clusters)} micro-clusters")
    few = cluster.CluStream(max_micro_clusters=100, time_window=len(points))
    yield Method("CluStream, river", one_by_one(few.learn_one), data, "at most 100 micro-clusters",
                 lambda: f"{len(few.micro_clusters)} micro-clusters")


def moa(points):
    """MOA's jar inside `capymoa`, called directly: `capymoa` itself wraps few of its clusterers."""
    import jpype

    package = importlib.util.find_spec("capymoa")
    if package is None:
        raise ModuleNotFoundError("No module named 'capymoa'")
    jpype.startJVM(classpath=[str(Path(package.origin).parent / "jar" / "moa.jar")])

    def clusterer(path, options):
        made = jpype.JClass(f"moa.clusterers.{path}")()
        made.getOptions().setViaCLIString(options)
        made.prepareForUse()
        return made

    def micro_clusters(of):
        return lambda: f"{of.getMicroClusteringResult().size()} micro-clusters"

    # D-Stream takes whole numbers of cells, cut towards zero.
    cells = moa_instances(jpype, (points - points.min(axis=0)) / VOXEL_SIZE + 1)
    grid = clusterer("dstream.Dstream", "-d 0.999")
    yield Method("D-Stream, MOA", one_by_one(grid.trainOnInstance), cells,
                 f"cells of {VOXEL_SIZE} m, fading 0.999 a point, the least that it takes",
                 lambda: f"{moa_field(grid, 'grid_list').size()} cells")
    instances = moa_instances(jpype, points)
    few = clusterer("clustream.Clustream", f"-h {len(points)} -k 100")
    yield Method("CluStream, MOA", one_by_one(few.trainOnInstance), instances, "at most 100 micro-clusters",
                 micro_clusters(few))
    fading = f"{TICK / len(points):.7f}"
    dense = clusterer("denstream.WithDBSCAN",
                      f"-h {len(points)} -e {VOXEL_SIZE} -m {MIN_POINTS} -b 0.2 -l {fading} -s {TICK}")
    yield Method("DenStream, MOA", one_by_one(dense.trainOnInstance), instances,
                 f"epsilon {VOXEL_SIZE} m, mu {MIN_POINTS}", micro_clusters(dense))
    coreset = clusterer("streamkm.StreamKM", f"-l {len(points)}")
    yield Method("StreamKM++, MOA", one_by_one(coreset.trainOnInstance), instances, "a coreset of 10,000 points, k 5",
                 lambda: "buckets of points")


def one_by_one(learn):
    def take(chunk):
        for point in chunk:
            learn(point)
    return take


def moa_instances(jpype, points):
    data = jpype.JPackage("com").yahoo.labs.samoa.instances
    attributes = jpype.java.util.ArrayList([data.Attribute(name) for name in "xyz"])
    header = data.InstancesHeader(data.Instances("scan", attributes, 0))
    made = []
    for point in points.tolist():
        instance = data.DenseInstance(1.0, point)
        instance.setDataset(header)
        made.append(instance)
    return made


def moa_field(clusterer, name):
    field = clusterer.getClass().getDeclaredField(name)
    field.setAccessible(True)
    return field.get(clusterer)


def incdbscan(points):
    from incdbscan import IncrementalDBSCAN

    method = IncrementalDBSCAN(eps=VOXEL_SIZE, min_pts=MIN_POINTS)
    yield Method("IncrementalDBSCAN, incdbscan", method.insert, points, f"eps {VOXEL_SIZE} m, min_pts {MIN_POINTS}",
                 lambda: "all points")


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
