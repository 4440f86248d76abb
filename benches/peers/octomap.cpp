// OctoMap: one scan more in an occupancy octree, as its users do it live:  octomap SCANS STEP
//
// `insertPointCloud` with lazy_eval, so inner nodes are not brought up to date, and discretize, so one ray is cast for
// each voxel with points. The points are in the fixed frame already; neither that transform nor the
// `updateInnerOccupancy` that some queries need first is in the time.

#include <octomap/octomap.h>

#include <cstdio>

#include "scans.hpp"

namespace {

double milliseconds_a_scan(const std::vector<peers::Scan>& scans, double voxel_size) {
  octomap::OcTree tree(voxel_size);
  std::vector<double> times;
  for (const peers::Scan& scan : scans) {
    octomap::Pointcloud cloud;
    cloud.reserve(scan.points.size());
    for (const peers::Point& point : scan.points) {
      const peers::Point p = scan.in_fixed_frame(point);
      cloud.push_back(p.x, p.y, p.z);
    }
    const peers::Point s = scan.sensor();
    const octomap::point3d origin(s.x, s.y, s.z);
    times.push_back(peers::milliseconds([&] { tree.insertPointCloud(cloud, origin, -1.0, true, true); }));
  }
  std::fprintf(stderr, "octomap %.2f m: %zu nodes at the end\n", voxel_size, tree.calcNumNodes());
  return peers::median(times);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) throw std::invalid_argument("usage: octomap SCANS STEP");
  const auto scans = peers::read_scans(argv[1], std::stoul(argv[2]));
  for (const double size : {0.08, 0.05})
    std::printf("peer octomap %.2f median_ms %.3f\n", size, milliseconds_a_scan(scans, size));
}
