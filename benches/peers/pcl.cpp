// PCL: surfaces by voxels, normals and region growing, of each scan alone and of the whole map:  pcl SCANS STEP REPEATS
//
// The fastest of what PCL offers for it: VoxelGrid over valid points only (an organised cloud with NaN takes 6 % more);
// a kd-tree that leaves neighbours unsorted (sorted, normals take a third more; an octree takes twice as long for both
// steps); normals from a radius of two voxels; ten neighbours for the growth. Planes of every pixel of an organised
// cloud (IntegralImageNormalEstimation, OrganizedMultiPlaneSegmentation) take seven times as long. The thresholds decide
// what comes out and hardly the time: nine tenths of a scan's voxels are in clusters, a third of the map's at 8 cm, whose
// noise from many views lies several voxels thick. A scan is segmented in the sensor's frame.
//
// To be built with PCL_NO_PRECOMPILE: else the templates come from Debian's library, made for any x86-64, which takes
// two fifths more, and which crashes in a program built with -march=native.

#include <pcl/features/normal_3d.h>
#include <pcl/filters/voxel_grid.h>
#include <pcl/point_types.h>
#include <pcl/search/kdtree.h>
#include <pcl/segmentation/region_growing.h>

#include <cstdio>

#include "scans.hpp"

namespace {

using Cloud = pcl::PointCloud<pcl::PointXYZ>;
using Normals = pcl::PointCloud<pcl::Normal>;
using Clusters = std::vector<pcl::PointIndices>;

constexpr unsigned kDense = 15;  // points that make a voxel of the map dense, our `min_points`

Cloud::Ptr centroids(const Cloud::ConstPtr& points, float voxel_size, unsigned min_points) {
  pcl::VoxelGrid<pcl::PointXYZ> grid;
  grid.setLeafSize(voxel_size, voxel_size, voxel_size);
  grid.setDownsampleAllData(false);
  grid.setMinimumPointsNumberPerVoxel(min_points);
  grid.setInputCloud(points);
  const Cloud::Ptr voxels(new Cloud);
  grid.filter(*voxels);
  return voxels;
}

Clusters surfaces(const Cloud::ConstPtr& voxels, float voxel_size) {
  const pcl::search::KdTree<pcl::PointXYZ>::Ptr tree(new pcl::search::KdTree<pcl::PointXYZ>(false));
  pcl::NormalEstimation<pcl::PointXYZ, pcl::Normal> estimation;
  estimation.setSearchMethod(tree);
  estimation.setRadiusSearch(2 * voxel_size);
  estimation.setInputCloud(voxels);
  const Normals::Ptr normals(new Normals);
  estimation.compute(*normals);

  pcl::RegionGrowing<pcl::PointXYZ, pcl::Normal> growing;
  growing.setSearchMethod(tree);
  growing.setNumberOfNeighbours(10);
  growing.setSmoothnessThreshold(0.17F);
  growing.setCurvatureThreshold(0.05F);
  growing.setMinClusterSize(10);
  growing.setInputCloud(voxels);
  growing.setInputNormals(normals);
  Clusters clusters;
  growing.extract(clusters);
  return clusters;
}

void tell(const char* what, float voxel_size, const Cloud& voxels, const Clusters& clusters) {
  std::size_t labelled = 0;
  for (const auto& cluster : clusters) labelled += cluster.indices.size();
  std::fprintf(stderr, "%s %.2f m: %zu voxels, %zu clusters with %zu of them\n", what, voxel_size, voxels.size(),
               clusters.size(), labelled);
}

// Every scan alone: nothing is kept from one to the next.
double milliseconds_a_scan(const std::vector<Cloud::Ptr>& clouds, float voxel_size) {
  std::vector<double> times;
  for (const Cloud::Ptr& cloud : clouds) {
    Cloud::Ptr voxels;
    Clusters clusters;
    times.push_back(peers::milliseconds([&] {
      voxels = centroids(cloud, voxel_size, 0);
      clusters = surfaces(voxels, voxel_size);
    }));
    if (cloud == clouds.back()) tell("pcl, last scan", voxel_size, *voxels, clusters);
  }
  return peers::median(times);
}

// The map at the end, held as the centroids of its dense voxels, clustered anew. How it got there is not in the time.
double milliseconds_of_the_map(const Cloud::ConstPtr& points, float voxel_size, int repeats) {
  const Cloud::Ptr map = centroids(points, voxel_size, kDense);
  Clusters clusters;
  std::vector<double> times;
  for (int i = 0; i < repeats; ++i)
    times.push_back(peers::milliseconds([&] { clusters = surfaces(map, voxel_size); }));
  tell("pcl, map", voxel_size, *map, clusters);
  return peers::median(times);
}

Cloud::Ptr cloud_of(const peers::Scan& scan) {
  const Cloud::Ptr cloud(new Cloud);
  cloud->reserve(scan.points.size());
  for (const peers::Point& p : scan.points) cloud->emplace_back(p.x, p.y, p.z);
  return cloud;
}

Cloud::Ptr all_in_the_fixed_frame(const std::vector<peers::Scan>& scans) {
  const Cloud::Ptr cloud(new Cloud);
  for (const peers::Scan& scan : scans)
    for (const peers::Point& point : scan.points) {
      const peers::Point p = scan.in_fixed_frame(point);
      cloud->emplace_back(p.x, p.y, p.z);
    }
  return cloud;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) throw std::invalid_argument("usage: pcl SCANS STEP REPEATS");
  const auto scans = peers::read_scans(argv[1], std::stoul(argv[2]));
  std::vector<Cloud::Ptr> clouds;
  for (const peers::Scan& scan : scans) clouds.push_back(cloud_of(scan));
  const Cloud::Ptr all = all_in_the_fixed_frame(scans);
  for (const float size : {0.08F, 0.05F}) {
    std::printf("peer pcl_scan %.2f median_ms %.3f\n", size, milliseconds_a_scan(clouds, size));
    std::printf("peer pcl_map %.2f median_ms %.3f\n", size, milliseconds_of_the_map(all, size, std::stoi(argv[3])));
  }
}
