"""Open3D over each scan alone:  python open3d_scans.py SCANS STEP

Voxels, normals from ten neighbours, and one of two clusterings: `cluster_dbscan`, which tells things apart by the gaps
between them and no surfaces (on the cabinet recording: one cluster a scan), and `detect_planar_patches`, which finds
surfaces. Of its two interfaces the older one is taken: the tensor one's voxels take ten times as long on one core.
"""

import itertools
import statistics
import sys
import time

import numpy as np
import open3d as o3d

from scans import valid_points

DBSCAN_REACH = 1.8  # voxels: neighbours by face, edge or corner
DBSCAN_MIN_POINTS = 4


def main(scans, step):
    clouds = [o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points.astype(np.float64)))
              for points in itertools.islice(valid_points(scans), 0, None, step)]
    for size in (0.08, 0.05):
        times = [milliseconds(cloud, size) for cloud in clouds]
        for name in times[0]:
            print(f"peer {name} {size:.2f} median_ms {statistics.median(t[name] for t in times):.3f}")


def milliseconds(cloud, size):
    begin = time.perf_counter()
    voxels = cloud.voxel_down_sample(size)
    voxels.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(10))
    prepared = time.perf_counter()
    voxels.cluster_dbscan(DBSCAN_REACH * size, DBSCAN_MIN_POINTS)
    clustered = time.perf_counter()
    voxels.detect_planar_patches()
    end = time.perf_counter()
    return {
        "open3d_dbscan": 1000 * (clustered - begin),
        "open3d_patches": 1000 * (prepared - begin + end - clustered),
    }


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
