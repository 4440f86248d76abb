// What examples/planner.py makes of the map, in C++: it needs the messages alone, no rclcpp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <tuple>
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
  static constexpr double kAboveGround[] = {-0.05, 0.3};  // how high the origin of a base frame is [m]: below 0 by noise, not by a step
  static constexpr double kUnseen = 2.5;  // within this the ground may begin [m]: a level Kinect 1 m up sees none nearer
  static constexpr double kTilt = 0.05;  // what rises by more in a metre is not level [m/m]: in three it would hide one of kLow
  static constexpr double kConfident = 0.3;  // less is a guess: FLOOR and HORIZONTAL, one to a ground, may have a half each
  static constexpr double kFacesUp = 0.9;  // the least z of the normal of what can carry the robot: up to 26 degrees

  Planner(double width, double height) : width_(width), height_(height) {}

  MapReader map;  // feed it from ~/clusters and ~/clusters_delta

  // Takes a message of ~/points_labelled: an outline does not hold all voxels, see docs/planner.md.
  void points(const sensor_msgs::msg::PointCloud2& cloud) {
    voxels_.clear();
    header_ = cloud.header;
    if (cloud.data.empty()) return;  // the iterators take the address of its first byte
    for (sensor_msgs::PointCloud2ConstIterator<float> at(cloud, "x"); at != at.end(); ++at) voxels_.push_back({at[0], at[1], at[2]});
  }

  // Of the newest cloud of voxels; its stamp is 0 before there is one.
  const std_msgs::msg::Header& voxels_header() const { return header_; }

  // What the robot stands on: of the surfaces at its height the one that it is over or comes to first. None where that is not
  // known to be level: a level one further ahead may be the foot of a ramp.
  const Cluster* ground(const Robot& robot) const {
    const Cluster* first = nullptr;
    std::tuple<bool, double, bool, double> least;  // tentative, how far ahead it begins, not level, how far below the base it is
    for (const auto& [id, cluster] : map.clusters()) {
      double height = above(cluster, {robot.x, robot.y, robot.z});
      bool level = is_level(cluster);
      // The plane of what is not level may as well be off upwards: the robot is over it all the same.
      double lowest = level ? kAboveGround[0] : -kAboveGround[1];
      if (cluster.plane.coef[2] <= kFacesUp || height <= lowest || height >= kAboveGround[1]) continue;
      double begin = begins(cluster, cluster, robot, -kLow, kLow);
      std::tuple<bool, double, bool, double> place{cluster.state == Cluster::STATE_TENTATIVE, begin, !level, height};
      if (begin < kUnseen && (!first || place < least)) least = place, first = &cluster;
    }
    return first && is_level(*first) ? first : nullptr;
  }

  // The raised level surface that is nearest to a height above the ground, or none.
  std::optional<Table> table(const Cluster& ground, double wished_height) const {
    std::optional<Table> nearest;
    for (const auto& [id, cluster] : map.clusters()) {
      bool reliable = cluster.state != Cluster::STATE_TENTATIVE && is_level(cluster);
      if (cluster.surface_class != Cluster::CLASS_HORIZONTAL || !reliable) continue;
      double height = above(ground, xyz(cluster.pose.position));
      if (height <= kLow) continue;
      if (!nearest || std::abs(height - wished_height) < std::abs(nearest->height - wished_height)) nearest = Table{height, &cluster};
    }
    return nearest;
  }

  // How far from its base frame the robot can drive straight on [m]; infinite where nothing stands there.
  double free_ahead(const Cluster& ground, const Robot& robot) const {
    double free = kInfinite;
    for (const auto& voxel : voxels_) {
      auto [ahead, left, height] = from_robot(robot, ground, voxel);
      bool in_way = ahead > 0 && std::abs(left) < width_ / 2 && height > kLow && height < height_;
      if (in_way) free = std::min(free, ahead);
    }
    for (const auto& [id, cluster] : map.clusters()) {
      if (id != ground.id) free = std::min(free, begins(cluster, ground, robot, kLow, height_));
    }
    return free;
  }

 private:
  struct Piece { Point begin, end; };
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();

  template <typename P>
  static Point xyz(const P& point) { return {point.x, point.y, point.z}; }

  // How high a point is above a cluster's plane [m].
  static double above(const Cluster& cluster, const Point& point) {
    const auto& plane = cluster.plane.coef;
    return plane[0] * point[0] + plane[1] * point[1] + plane[2] * point[2] + plane[3];
  }

  // Whether a surface is known to be level: heights count from its plane, and things can be put on it.
  static bool is_level(const Cluster& cluster) {
    bool level = cluster.surface_class == Cluster::CLASS_FLOOR || cluster.surface_class == Cluster::CLASS_HORIZONTAL;
    const auto& plane = cluster.plane.coef;
    const auto& turns = cluster.plane_covariance;  // NaN where they are not known, which is less than nothing
    return level && cluster.class_confidence > kConfident && std::hypot(plane[0], plane[1]) < kTilt &&
           turns[0] < kTilt * kTilt && turns[4] < kTilt * kTilt;
  }

  // How far ahead and left of the robot a point is, and how high above the ground.
  static Point from_robot(const Robot& robot, const Cluster& ground, const Point& point) {
    double x = point[0] - robot.x, y = point[1] - robot.y, cos = std::cos(robot.yaw), sin = std::sin(robot.yaw);
    return {cos * x + sin * y, cos * y - sin * x, above(ground, point)};
  }

  // How far ahead a cluster begins in the robot's lane between two heights above the ground [m]; infinite where it does not.
  double begins(const Cluster& cluster, const Cluster& ground, const Robot& robot, double low, double high) const {
    const Point least{0.0, -width_ / 2, low}, most{kInfinite, width_ / 2, high};
    std::vector<Piece> pieces;
    add_sides(cluster.boundary, ground, robot, pieces);
    for (const auto& hole : cluster.holes) add_sides(hole, ground, robot, pieces);
    const auto sides = pieces;
    // A surface is flat: what of it is nearest is at its outline, or else where it meets an end or a side of the lane.
    add_cut(sides, 0, least[0], pieces);
    add_cut(sides, 1, least[1], pieces);
    add_cut(sides, 1, most[1], pieces);
    double first = kInfinite;
    for (const auto& piece : pieces) first = std::min(first, nearest(piece, least, most));
    return first;
  }

  // The sides of a ring, each from a corner to the next.
  template <typename Ring>
  static void add_sides(const Ring& ring, const Cluster& ground, const Robot& robot, std::vector<Piece>& to) {
    for (std::size_t i = 0; i < ring.points.size(); ++i) {
      const auto &corner = ring.points[i], &next = ring.points[(i + 1) % ring.points.size()];
      to.push_back({from_robot(robot, ground, xyz(corner)), from_robot(robot, ground, xyz(next))});
    }
  }

  // The pieces of what the sides enclose on the plane where this coordinate is `at`: a doorway is between two of them.
  static void add_cut(const std::vector<Piece>& sides, int axis, double at, std::vector<Piece>& to) {
    std::vector<Point> points;
    for (const auto& [begin, end] : sides) {
      if ((begin[axis] > at) == (end[axis] > at)) continue;
      points.push_back(between(begin, end, (at - begin[axis]) / (end[axis] - begin[axis])));
    }
    if (points.empty()) return;
    Point extent;
    for (int i = 0; i < 3; ++i) {
      auto [first, last] = std::minmax_element(points.begin(), points.end(), [i](auto& a, auto& b) { return a[i] < b[i]; });
      extent[i] = (*last)[i] - (*first)[i];
    }
    // They lie on a line: a wall's go up, a table's ahead.
    auto longest = std::max_element(extent.begin(), extent.end()) - extent.begin();
    std::sort(points.begin(), points.end(), [longest](auto& a, auto& b) { return a[longest] < b[longest]; });
    for (std::size_t i = 0; i + 1 < points.size(); i += 2) to.push_back({points[i], points[i + 1]});
  }

  // The least distance ahead of what of a piece is in a box; infinite where nothing is.
  static double nearest(const Piece& piece, const Point& least, const Point& most) {
    double enter = 0.0, leave = 1.0;  // where it comes into the box and leaves it, as shares of the way
    for (int i = 0; i < 3; ++i) {
      double way = piece.end[i] - piece.begin[i];
      if (way == 0.0) way = 1e-12;  // no division by 0
      // What is cut at the lane's sides is within it, rounded or not.
      double one = (least[i] - 1e-9 - piece.begin[i]) / way, other = (most[i] + 1e-9 - piece.begin[i]) / way;
      enter = std::max(enter, std::min(one, other));
      leave = std::min(leave, std::max(one, other));
    }
    if (enter > leave) return kInfinite;
    double first = between(piece.begin, piece.end, enter)[0], last = between(piece.begin, piece.end, leave)[0];
    return std::max(0.0, std::min(first, last));
  }

  static Point between(const Point& begin, const Point& end, double share) {
    auto at = [&](int i) { return begin[i] + share * (end[i] - begin[i]); };
    return {at(0), at(1), at(2)};
  }

  double width_, height_;
  std::vector<Point> voxels_;
  std_msgs::msg::Header header_;
};

// Whether map, voxels and pose are of now. A clock can be set, differ from the camera's and stand still, so a stamp must be
// near the clock, and have come not long ago by a clock that nobody sets.
class Freshness {
 public:
  using Headers = std::array<std_msgs::msg::Header, 3>;

  static constexpr double kAhead = 0.2;  // a stamp may be ahead of the clock by this [s]: clocks are not set more exactly

  explicit Freshness(double max_age) : max_age_(max_age) {}

  // Of these three, by the clock of the stamps and a steady one [s]; a time of 0 is none. Asked again and again.
  bool holds(const Headers& headers, double now, double steady) {
    bool fresh = now > 0.0;
    for (std::size_t i = 0; i < headers.size(); ++i) {
      double stamp = headers[i].stamp.sec + 1e-9 * headers[i].stamp.nanosec;
      if (came_[i].stamp != stamp) came_[i] = {stamp, steady};
      double age = now - stamp;
      fresh = fresh && stamp > 0.0 && -kAhead < age && age < max_age_ && steady - came_[i].since < max_age_;
    }
    return fresh;
  }

 private:
  struct Came { double stamp = 0.0, since = 0.0; };
  double max_age_;
  std::array<Came, 3> came_;
};
