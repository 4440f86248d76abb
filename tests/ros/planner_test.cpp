// What test_planner.py says of the planner in Python, of the one in C++.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>

#include "planner.hpp"

using Cluster = Planner::Cluster;
using Corners = std::initializer_list<std::array<float, 3>>;

const Planner::Robot kHere{0.0, 0.0, 0.1, 0.0};  // a base frame 10 cm above the ground, looking along x
const double kFree = std::numeric_limits<double>::infinity();

Cluster surface(std::uint64_t id, std::uint8_t surface_class, Corners corners, std::array<double, 3> normal = {0, 0, 1}) {
  Cluster cluster;
  cluster.id = id;
  cluster.surface_class = surface_class;
  cluster.state = Cluster::STATE_ACTIVE;
  cluster.area = 1.0;
  const auto& corner = *corners.begin();
  cluster.plane.coef = {normal[0], normal[1], normal[2], -(normal[0] * corner[0] + normal[1] * corner[1] + normal[2] * corner[2])};
  cluster.pose.position.z = corner[2];
  for (const auto& [x, y, z] : corners) {
    cluster.boundary.points.emplace_back();
    auto& point = cluster.boundary.points.back();
    point.x = x, point.y = y, point.z = z;
  }
  return cluster;
}

Cluster level(std::uint64_t id, std::uint8_t surface_class, float z, float x0, float x1, float y0, float y1) {
  return surface(id, surface_class, {{x0, y0, z}, {x1, y0, z}, {x1, y1, z}, {x0, y1, z}});
}

Planner planner(std::initializer_list<Cluster> clusters) {
  Planner known(0.5, 1.2);
  MapReader::Array map;
  map.session_id = 1;
  map.header.frame_id = "odom";
  map.clusters.assign(clusters);
  map.clusters.push_back(level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5));
  map.clusters.back().area = 100.0;
  known.map.snapshot(map);
  return known;
}

void expect(const char* sentence, bool holds) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", sentence);
  std::exit(1);
}

void expect(const char* sentence, double found, double expected) {
  if (found == expected || std::abs(found - expected) < 1e-6) return;
  std::fprintf(stderr, "not so: %s: %f, expected %f\n", sentence, found, expected);
  std::exit(1);
}

double free_ahead(std::initializer_list<Cluster> clusters, const Planner::Robot& robot = kHere) {
  Planner known = planner(clusters);
  return known.free_ahead(*known.ground(robot), robot);
}

void outlines() {
  auto wall = surface(2, Cluster::CLASS_WALL, {{2, -3, 0}, {2, 3, 0}, {2, 3, 2.5}, {2, -3, 2.5}}, {-1, 0, 0});
  expect("a wall is in the way though it ends above the robot", free_ahead({wall}), 2.0);
  expect("from nearer by it is nearer", free_ahead({wall}, {1.0, 1.0, 0.1, 0.0}), 1.0);
  expect("behind it is not in the way", free_ahead({wall}, {0.0, 0.0, 0.1, M_PI}), kFree);
  expect("a table is", free_ahead({level(3, Cluster::CLASS_HORIZONTAL, 0.7, 1.0, 1.8, -0.2, 0.6)}), 1.0);
  expect("beside the way it is not", free_ahead({level(3, Cluster::CLASS_HORIZONTAL, 0.7, 1.0, 1.8, 0.3, 0.6)}), kFree);
  expect("above the robot it is not", free_ahead({level(3, Cluster::CLASS_HORIZONTAL, 1.3, 1.0, 1.8, -0.2, 0.6)}), kFree);
  expect("the ground's noise is not", free_ahead({level(3, Cluster::CLASS_HORIZONTAL, 0.05, 1.0, 1.8, -0.2, 0.6)}), kFree);
}

struct Labelled { float x, y, z; std::uint32_t label; };

sensor_msgs::msg::PointCloud2 cloud(std::initializer_list<Labelled> points) {
  sensor_msgs::msg::PointCloud2 cloud;
  const char* names[] = {"x", "y", "z", "label"};
  for (std::uint32_t i = 0; i < 4; ++i) {
    cloud.fields.emplace_back();
    cloud.fields.back().name = names[i];
    cloud.fields.back().offset = 4 * i;
    cloud.fields.back().datatype = i == 3 ? sensor_msgs::msg::PointField::UINT32 : sensor_msgs::msg::PointField::FLOAT32;
    cloud.fields.back().count = 1;
  }
  cloud.height = 1, cloud.width = points.size(), cloud.point_step = 16, cloud.row_step = 16 * points.size();
  cloud.data.resize(cloud.row_step);
  std::memcpy(cloud.data.data(), points.begin(), cloud.row_step);
  return cloud;
}

void voxels() {
  Planner known = planner({level(2, Cluster::CLASS_HORIZONTAL, 0.7, 2.0, 2.8, -0.2, 0.6)});
  const Cluster& ground = *known.ground(kHere);
  known.points(cloud({{1.5, 0.1, 0.4, 0}, {0.7, 0.0, 0.0, 1}, {0.6, 0.0, 0.3, 1}, {0.5, 0.4, 0.3, 0}, {1.2, 0.0, 1.5, 0}}));
  expect("those of cluster 1 are ground", known.free_ahead(ground, kHere), 1.5);
  known.points(cloud({{0.8, 0.0, 0.3, 77}}));
  expect("those of a cluster without an outline are in the way", known.free_ahead(ground, kHere), 0.8);
  known.points(cloud({{1.0, 0.0, 0.7, 2}}));
  expect("and those of one whose outline is that of another part", known.free_ahead(ground, kHere), 1.0);
}

void ground_and_table() {
  Cluster lower = level(2, Cluster::CLASS_FLOOR, -0.8, -9, 9, -9, 9);
  lower.area = 300.0;
  Cluster shelf = level(3, Cluster::CLASS_HORIZONTAL, 1.1, 1, 2, 0, 1), desk = level(4, Cluster::CLASS_HORIZONTAL, 0.7, 1, 2, 0, 1);
  Cluster fresh = level(5, Cluster::CLASS_HORIZONTAL, 0.76, 1, 2, 0, 1);
  fresh.state = Cluster::STATE_TENTATIVE;
  Planner known = planner({lower, shelf, desk, fresh});
  expect("the ground is what the robot stands on", known.ground(kHere) && known.ground(kHere)->id == 1);
  expect("in the air there is none", !known.ground({0.0, 0.0, 5.0, 0.0}));
  const Cluster& ground = *known.ground(kHere);
  expect("the desk is nearest to 0.75 m", known.table(ground, 0.75)->cluster->id == 4);
  expect("its height is above the ground", known.table(ground, 0.75)->height, 0.7);
  expect("the shelf is nearest to 1 m", known.table(ground, 1.0)->cluster->id == 3);
  expect("an empty room has no table", !planner({}).table(level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5), 0.75));
  expect("the map's frame is that of its newest message", known.map.header().frame_id == "odom");
}

int main() {
  outlines();
  voxels();
  ground_and_table();
}
