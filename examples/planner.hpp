// What examples/planner.py makes of the map, in C++: it needs the messages alone, no rclcpp.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iomanip>
#include <limits>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include <sensor_msgs/msg/point_cloud2.hpp>
#include <tf2_msgs/msg/tf_message.hpp>

#include "map_reader.hpp"

// Why the robot stands: the reason is the same for as long as it is so, its numbers are of now.
struct Why { std::string reason, numbers; };

// All of these in a row, numbers with four digits.
template <typename... Parts>
std::string in_words(const Parts&... parts) {
  std::ostringstream to;
  to << std::setprecision(4);
  (to << ... << parts);
  return to.str();
}

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

  // Takes a message of ~/points_labelled: an outline does not hold all voxels, see docs/planner.md. std::invalid_argument where it
  // is none, for the iterators of sensor_msgs read beyond its end then.
  void points(const sensor_msgs::msg::PointCloud2& cloud) {
    voxels_ = cloud.data.empty() ? std::vector<Point>() : voxels_of(cloud);
    header_ = cloud.header;
  }

  // Of the newest cloud of voxels; its stamp is 0 before there is one.
  const std_msgs::msg::Header& voxels_header() const { return header_; }

  // What the robot stands on: of the surfaces at its height the one that it is over or comes to first. None where that is not
  // known to be level: a level one further ahead may be the foot of a ramp.
  const Cluster* ground(const Robot& robot) const {
    const auto* first = stands_on(robot);
    return first && is_level(*first) ? first : nullptr;
  }

  // That surface, level or not; none where none is seen.
  const Cluster* stands_on(const Robot& robot) const {
    const Cluster* first = nullptr;
    std::tuple<bool, double, bool, double> least;  // tentative, how far ahead it begins, not level, how far below the base it is
    for (const auto& [id, cluster] : map.clusters()) {
      double height = above(cluster, {robot.x, robot.y, robot.z});
      bool level = is_level(cluster);
      // The plane of what is not level may as well be off upwards: the robot is over it all the same.
      double lowest = level ? kAboveGround[0] : -kAboveGround[1];
      if (!(cluster.plane.coef[2] > kFacesUp && lowest < height && height < kAboveGround[1])) continue;
      double begin = begins(cluster, cluster, robot, -kLow, kLow);
      std::tuple<bool, double, bool, double> place{cluster.state == Cluster::STATE_TENTATIVE, begin, !level, height};
      if (begin < kUnseen && (!first || place < least)) least = place, first = &cluster;
    }
    return first;
  }

  Why no_ground(const Robot& robot) const {
    const auto* first = stands_on(robot);
    if (!first) {
      return {in_words("no floor is seen below the robot or up to ", kUnseen, " m ahead"),
              in_words("its base frame is at (", robot.x, ", ", robot.y, ", ", robot.z, ")")};
    }
    const auto& turns = first->plane_covariance;
    double rise = std::hypot(first->plane.coef[0], first->plane.coef[1]);
    double known = std::sqrt(std::max({turns[0], turns[4], 0.0}));
    return {"what is below the robot or first ahead is not known to be level",
            in_words("cluster ", first->id, ": class ", int{first->surface_class}, ", confidence ", first->class_confidence,
                     ", rises by ", rise, " m/m, which is known to ", known)};
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

  // The points of a cloud that has some.
  static std::vector<Point> voxels_of(const sensor_msgs::msg::PointCloud2& cloud) {
    const std::size_t step = cloud.point_step, size = cloud.data.size(), at[] = {offset(cloud, "x"), offset(cloud, "y"), offset(cloud, "z")};
    if (step == 0 || size % step != 0) {
      throw std::invalid_argument(in_words("a cloud of labelled points has ", size, " bytes, of points of ", step));
    }
    std::vector<Point> voxels;
    for (const std::uint8_t* point = cloud.data.data(); point != cloud.data.data() + size; point += step) {
      std::array<float, 3> voxel;
      for (int i = 0; i < 3; ++i) std::memcpy(&voxel[i], point + at[i], sizeof(float));
      voxels.push_back({voxel[0], voxel[1], voxel[2]});
    }
    return voxels;
  }

  // Where a point of a cloud has a coordinate.
  static std::size_t offset(const sensor_msgs::msg::PointCloud2& cloud, const char* axis) {
    for (const auto& field : cloud.fields) {
      bool is_float = field.datatype == sensor_msgs::msg::PointField::FLOAT32 && !cloud.is_bigendian;
      if (field.name == axis && is_float && field.offset + sizeof(float) <= cloud.point_step) return field.offset;
    }
    throw std::invalid_argument(in_words("a cloud of labelled points of ", cloud.point_step, " bytes has no 32-bit ", axis));
  }

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
  struct Seen { std::string what; std_msgs::msg::Header header; std::string hint; };  // what to look at where it does not come
  using All = std::array<Seen, 3>;

  static constexpr double kAhead = 0.2;  // a stamp may be ahead of the clock by this [s]: clocks are not set more exactly

  explicit Freshness(double max_age) : max_age_(max_age) {}

  // Which of these is not of now, none where all are. The stamps and `now` are of one clock, `steady` of a steady one [s]; a time
  // of 0 is none. Asked again and again.
  std::optional<Why> lacks(const All& all, double now, double steady) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      double stamp = seconds(all[i].header);
      bool same = came_[i].what == all[i].what;
      if (!same || came_[i].stamp != stamp) came_[i] = {all[i].what, stamp, steady, same && came_[i].stamp > 0.0};
    }
    if (now <= 0.0) return Why{"no time has come on /clock", "use_sim_time asks for it"};
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (auto why = lack(all[i], now - came_[i].stamp, steady - came_[i].since, came_[i].again)) return why;
    }
    return std::nullopt;
  }

 private:
  struct Came { std::string what; double stamp = 0.0, since = 0.0; bool again = false; };

  static double seconds(const std_msgs::msg::Header& header) { return header.stamp.sec + 1e-9 * header.stamp.nanosec; }

  // The same of one of them, by its age and how long ago it came [s], and whether one came before.
  std::optional<Why> lack(const Seen& seen, double age, double since, bool again) const {
    bool lags = again && age >= max_age_ && since < max_age_;
    auto hint = lags ? "it comes, and its stamps are behind the clock" : seen.hint;
    auto allowed = in_words("max_age is ", max_age_, " s", hint.empty() ? "" : "; " + hint);
    if (seconds(seen.header) <= 0.0) return Why{"no " + seen.what + " has come", seen.hint};
    if (age >= max_age_) return Why{"the " + seen.what + " is too old", in_words(age, " s, ", allowed)};
    if (age <= -kAhead) return Why{"the " + seen.what + " is ahead of the clock", in_words("by ", -age, " s: two clocks differ")};
    if (since < max_age_) return std::nullopt;
    return Why{"no new " + seen.what + " comes", in_words("for ", since, " s, ", allowed)};
  }

  double max_age_;
  std::array<Came, 3> came_;
};

// What docs/planner.md says of them [m, m/s, s].
struct Parameters {
  std::string base_frame = "base_link";
  double width = 0.5, height = 1.2, wished_height = 0.75, speed = 0.3, stop_before = 0.5, slow_from = 1.5, max_age = 1.0;

  // Why nobody can drive by these, with their numbers; empty where one can.
  std::string impossible() const {
    const std::pair<const char*, double> numbers[] = {
        {"width", width}, {"height", height}, {"wished_height", wished_height}, {"speed", speed},
        {"stop_before", stop_before}, {"slow_from", slow_from}, {"max_age", max_age}};
    for (auto [name, value] : numbers) {
      if (value >= 0.0 && std::isfinite(value)) continue;
      return in_words(name, " is ", value, "; it must be a finite number and not below 0");
    }
    const std::tuple<const char*, double, double> limits[] = {
        {"width", width, 0.0}, {"height", height, Planner::kLow}, {"max_age", max_age, 0.0}};
    for (auto [name, value, least] : limits) {
      if (value <= least) return in_words(name, " is ", value, "; it must be more than ", least);
    }
    if (slow_from > stop_before) return "";
    return in_words("slow_from is ", slow_from, " and stop_before is ", stop_before,
                    "; slow_from must be more, for the robot slows down between the two");
  }
};

// How fast the robot drives by what has come, and why it stands.
class Driver {
 public:
  struct Speed { double value; std::optional<Why> why; };  // [m/s]; why it stands, none where it drives

  // std::invalid_argument if it cannot drive so.
  explicit Driver(const Parameters& given)
      : planner(given.width, given.height), given_(possible(given)), freshness_(given.max_age) {}

  Planner planner;  // feed it as it says
  std::optional<Planner::Table> table;  // none while it does not see one; its cluster is the map's

  // Takes a message of /tf.
  void transforms(const tf2_msgs::msg::TFMessage& message) {
    for (const auto& transform : message.transforms) {
      if (bare(transform.child_frame_id) == bare(given_.base_frame)) poses_[bare(transform.header.frame_id)] = transform;
    }
  }

  // By two clocks, as Freshness::lacks has it.
  Speed speed(double now, double steady) {
    const auto& map = planner.map.header();
    auto pose = poses_.find(map.frame_id);
    table.reset();
    Freshness::All seen{{
        {"map", map, "cfodi is not heard, or takes in no scan"},
        {"cloud of labelled points", planner.voxels_header(), "large ones are lost where net.core.rmem_default is small"},
        {"transform from `" + map.frame_id + "` straight to `" + bare(given_.base_frame) + "`",
         pose == poses_.end() ? std_msgs::msg::Header() : pose->second.header, ""},
    }};
    // A robot that sees nothing, or does not know where it is, stands.
    if (auto lack = freshness_.lacks(seen, now, steady)) return {0.0, lack};
    if (auto why = differs()) return {0.0, why};
    if (auto why = no_place(pose->second.transform)) return {0.0, why};
    Planner::Robot robot = place(pose->second.transform);
    const auto* ground = planner.ground(robot);
    if (!ground) return {0.0, planner.no_ground(robot)};
    table = planner.table(*ground, given_.wished_height);
    return before(planner.free_ahead(*ground, robot));
  }

  // The same, where the robot can drive so far straight on [m].
  Speed before(double free) const {
    double stop_before = given_.stop_before;
    if (free <= stop_before) {
      return {0.0, Why{"an obstacle is ahead", in_words(free, " m from the base frame, stop_before is ", stop_before, " m")}};
    }
    if (given_.speed == 0.0) return {0.0, Why{"the parameter speed is 0", ""}};
    return {given_.speed * std::min((free - stop_before) / (given_.slow_from - stop_before), 1.0), std::nullopt};
  }

 private:
  static const Parameters& possible(const Parameters& given) {
    if (auto why = given.impossible(); !why.empty()) throw std::invalid_argument(why);
    return given;
  }

  // Whether what has come does not belong together.
  std::optional<Why> differs() {
    const auto& frame = planner.map.header().frame_id;
    const auto& other = planner.voxels_header().frame_id;
    if (other != frame) {
      return Why{"map and labelled points are in different frames", "`" + frame + "` and `" + other + "`: are they of one node?"};
    }
    if (!session_id_) session_id_ = planner.map.session_id();
    if (planner.map.session_id() == *session_id_) return std::nullopt;
    // What stands before the robot may be too near to be seen again.
    return Why{"a new session has begun, which may know nothing of what was seen before", "see that the way is free and start again"};
  }

  // The name of a frame without the slash that ROS 1 has before it, as cfodi takes it.
  static std::string bare(const std::string& frame) { return frame.substr(std::min(frame.find_first_not_of('/'), frame.size())); }

  // Why it is none, if so: an odometry that has lost itself may send no numbers, or no rotation, which cfodi and tf2 refuse.
  static std::optional<Why> no_place(const geometry_msgs::msg::Transform& transform) {
    const auto& at = transform.translation;
    const auto& q = transform.rotation;
    bool is_turned = std::abs(std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w) - 1.0) < 0.01;
    if (is_turned && std::isfinite(at.x) && std::isfinite(at.y) && std::isfinite(at.z)) return std::nullopt;
    return Why{"the robot's transform is no place", in_words("translation (", at.x, ", ", at.y, ", ", at.z, "), rotation (", q.x, ", ",
                                                             q.y, ", ", q.z, ", ", q.w, ")")};
  }

  static Planner::Robot place(const geometry_msgs::msg::Transform& transform) {
    const auto& at = transform.translation;
    const auto& q = transform.rotation;
    return {at.x, at.y, at.z, std::atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))};
  }

  Parameters given_;
  std::optional<std::uint64_t> session_id_;  // of the first map that it has driven by
  Freshness freshness_;
  std::map<std::string, geometry_msgs::msg::TransformStamped> poses_;
};

// Puts into words why the robot stands: when the reason is a new one, though not more than once a second, and every 5 s.
class Standing {
 public:
  // What to say now, by a steady clock [s]; `why` is none while the robot drives.
  std::optional<std::string> line(const std::optional<Why>& why, double steady) {
    if (!why) {
      reason_.clear();
      return std::nullopt;
    }
    if (steady - said_ < (why->reason == reason_ ? 5.0 : 1.0)) return std::nullopt;
    reason_ = why->reason, said_ = steady;
    return "the robot stands: " + why->reason + (why->numbers.empty() ? "" : " (" + why->numbers + ")");
  }

 private:
  std::string reason_;
  double said_ = -std::numeric_limits<double>::infinity();
};
