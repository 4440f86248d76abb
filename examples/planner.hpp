// What examples/planner.py makes of the map, in C++: it needs the messages alone, no rclcpp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include <sensor_msgs/msg/point_cloud2.hpp>
#include <sensor_msgs/point_cloud2_iterator.hpp>

#include "map_reader.hpp"

class Planner {
 public:
  using Cluster = cfodi_msgs::msg::SurfaceCluster;
  using Point = std::array<double, 3>;
  struct Robot { double x, y, z, yaw; };  // its base frame in the map's frame
  struct Table { double height; const Cluster* cluster; };

  static constexpr double kLow = 0.15;  // what stands out less from the ground is no obstacle [m]: a camera's noise
  static constexpr double kAboveGround = 0.3;  // how high the origin of a base frame is at most [m]
  static constexpr double kStep = 0.05;  // between two points along an outline [m]

  Planner(double width, double height) : width_(width), height_(height) {}

  MapReader map;  // feed it from ~/clusters and ~/clusters_delta

  // Takes a message of ~/points_labelled: an outline does not hold all voxels, see docs/planner.md.
  void points(const sensor_msgs::msg::PointCloud2& cloud) {
    voxels_.clear();
    header_ = cloud.header;
    sensor_msgs::PointCloud2ConstIterator<float> at(cloud, "x");
    sensor_msgs::PointCloud2ConstIterator<std::uint32_t> label(cloud, "label");
    for (; at != at.end(); ++at, ++label) voxels_.push_back({{at[0], at[1], at[2]}, *label});
  }

  // Of the newest cloud of voxels; its stamp is 0 before there is one.
  const std_msgs::msg::Header& voxels_header() const { return header_; }

  // What the robot stands on: the largest of the level surfaces under its base frame, or none.
  const Cluster* ground(const Robot& robot) const {
    const Cluster* largest = nullptr;
    for (const auto& [id, cluster] : map.clusters()) {
      bool level = cluster.surface_class == Cluster::CLASS_FLOOR || cluster.surface_class == Cluster::CLASS_HORIZONTAL;
      if (!level || std::abs(above(cluster, {robot.x, robot.y, robot.z})) >= kAboveGround) continue;
      if (!largest || cluster.area > largest->area) largest = &cluster;
    }
    return largest;
  }

  // The raised level surface that is nearest to a height above the ground, or none.
  std::optional<Table> table(const Cluster& ground, double wished_height) const {
    std::optional<Table> nearest;
    for (const auto& [id, cluster] : map.clusters()) {
      if (cluster.surface_class != Cluster::CLASS_HORIZONTAL || cluster.state == Cluster::STATE_TENTATIVE) continue;
      double height = above(ground, xyz(cluster.pose.position));
      if (height <= kLow) continue;
      if (!nearest || std::abs(height - wished_height) < std::abs(nearest->height - wished_height)) nearest = Table{height, &cluster};
    }
    return nearest;
  }

  // How far from its base frame the robot can drive straight on [m]; infinite where nothing stands there.
  double free_ahead(const Cluster& ground, const Robot& robot) const {
    double free = std::numeric_limits<double>::infinity();
    for (const auto& voxel : voxels_) {
      double height = above(ground, voxel.centre);
      if (voxel.label != ground.id && height > kLow && height < height_) free = std::min(free, ahead(voxel.centre, robot));
    }
    for (const auto& [id, cluster] : map.clusters()) {
      double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
      for (const auto& corner : cluster.boundary.points) {
        lowest = std::min(lowest, above(ground, xyz(corner)));
        highest = std::max(highest, above(ground, xyz(corner)));
      }
      if (highest <= kLow || lowest >= height_) continue;  // a wall is in the way though it ends above the robot
      for (const auto& point : along(cluster.boundary)) free = std::min(free, ahead(point, robot));
    }
    return free;
  }

 private:
  struct Voxel { Point centre; std::uint32_t label; };

  template <typename P>
  static Point xyz(const P& point) { return {point.x, point.y, point.z}; }

  // How high a point is above a cluster's plane [m].
  static double above(const Cluster& cluster, const Point& point) {
    const auto& plane = cluster.plane.coef;
    return plane[0] * point[0] + plane[1] * point[1] + plane[2] * point[2] + plane[3];
  }

  static std::vector<Point> along(const geometry_msgs::msg::Polygon& boundary) {
    std::vector<Point> points;
    for (std::size_t i = 0; i < boundary.points.size(); ++i) {
      Point from = xyz(boundary.points[i]), to = xyz(boundary.points[(i + 1) % boundary.points.size()]);
      double length = std::hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]);
      int steps = std::max(1, static_cast<int>(std::ceil(length / kStep)));
      for (int step = 0; step < steps; ++step) {
        double share = static_cast<double>(step) / steps;
        points.push_back({from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]), from[2] + share * (to[2] - from[2])});
      }
    }
    return points;
  }

  // How far ahead a point is within the robot's width; infinite where it is beside or behind.
  double ahead(const Point& point, const Robot& robot) const {
    double x = point[0] - robot.x, y = point[1] - robot.y;
    double ahead = std::cos(robot.yaw) * x + std::sin(robot.yaw) * y, left = std::cos(robot.yaw) * y - std::sin(robot.yaw) * x;
    return ahead > 0 && std::abs(left) < width_ / 2 ? ahead : std::numeric_limits<double>::infinity();
  }

  double width_, height_;
  std::vector<Voxel> voxels_;
  std_msgs::msg::Header header_;
};
