// What test_planner.py says of the planner in Python, of the one in C++.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <vector>

#include "planner.hpp"

using Cluster = Planner::Cluster;
using Corners = std::vector<std::array<float, 3>>;

const Planner::Robot kHere{0.0, 0.0, 0.1, 0.0};  // a base frame 10 cm above the ground, looking along x
const double kFree = std::numeric_limits<double>::infinity();

template <typename Ring>
void add_corners(const Corners& corners, Ring& ring) {
  for (const auto& [x, y, z] : corners) {
    ring.points.emplace_back();
    auto& point = ring.points.back();
    point.x = x, point.y = y, point.z = z;
  }
}

Cluster surface(std::uint64_t id, std::uint8_t surface_class, const Corners& corners, std::array<double, 3> normal = {0, 0, 1}) {
  Cluster cluster;
  cluster.id = id;
  cluster.surface_class = surface_class;
  cluster.class_confidence = 0.9f;
  cluster.state = Cluster::STATE_ACTIVE;
  cluster.area = 1.0;
  const auto& corner = *corners.begin();
  cluster.plane.coef = {normal[0], normal[1], normal[2], -(normal[0] * corner[0] + normal[1] * corner[1] + normal[2] * corner[2])};
  cluster.pose.position.z = corner[2];
  add_corners(corners, cluster.boundary);
  return cluster;
}

// 2 m ahead, across the robot's way.
Cluster wall(const Corners& corners) { return surface(2, Cluster::CLASS_WALL, corners, {-1, 0, 0}); }

Corners box(float y, float low, float high) { return {{2, -y, low}, {2, y, low}, {2, y, high}, {2, -y, high}}; }

Cluster level(std::uint64_t id, std::uint8_t surface_class, float z, float x0, float x1, float y0, float y1) {
  return surface(id, surface_class, {{x0, y0, z}, {x1, y0, z}, {x1, y1, z}, {x0, y1, z}});
}

// 2 m wide; it is at z = 0 where it begins, and rises from there.
Cluster tilted(std::uint64_t id, std::uint8_t surface_class, float tilt, float x0, float x1) {
  float rise = std::tan(tilt) * (x1 - x0);
  return surface(id, surface_class, {{x0, -1, 0}, {x1, -1, rise}, {x1, 1, rise}, {x0, 1, 0}}, {-std::sin(tilt), 0, std::cos(tilt)});
}

Planner seen(const std::vector<Cluster>& clusters) {
  Planner known(0.5, 1.2);
  MapReader::Array map;
  map.session_id = 1;
  map.header.frame_id = "odom";
  map.clusters.assign(clusters.begin(), clusters.end());
  known.map.snapshot(map);
  return known;
}

Planner planner(std::vector<Cluster> clusters) {
  clusters.push_back(level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5));
  clusters.back().area = 100.0;
  return seen(clusters);
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
  auto across = wall(box(3, 0, 2.5));
  expect("a wall is in the way though it ends above the robot", free_ahead({across}), 2.0);
  expect("from nearer by it is nearer", free_ahead({across}, {1.0, 1.0, 0.1, 0.0}), 1.0);
  expect("behind it is not in the way", free_ahead({across}, {0.0, 0.0, 0.1, M_PI}), kFree);
  expect("a table is", free_ahead({level(3, Cluster::CLASS_HORIZONTAL, 0.7, 1.0, 1.8, -0.2, 0.6)}), 1.0);
  expect("beside the way it is not", free_ahead({level(3, Cluster::CLASS_HORIZONTAL, 0.7, 1.0, 1.8, 0.3, 0.6)}), kFree);
  expect("above the robot it is not", free_ahead({level(3, Cluster::CLASS_HORIZONTAL, 1.3, 1.0, 1.8, -0.2, 0.6)}), kFree);
  expect("the ground's noise is not", free_ahead({level(3, Cluster::CLASS_HORIZONTAL, 0.05, 1.0, 1.8, -0.2, 0.6)}), kFree);
}

void within_outlines() {
  const double s = std::sqrt(0.5);
  expect("a wall is in the way though its outline is all around", free_ahead({wall(box(3, -0.5, 2.5))}), 2.0);
  auto top = level(3, Cluster::CLASS_HORIZONTAL, 0.7, 1, 2, -1.5, 1.5);
  expect("so is a wide table", free_ahead({top}), 1.0);
  expect("within it there is no way", free_ahead({top}, {1.5, 0.0, 0.1, 0.0}), 0.0);
  auto slanting = surface(2, Cluster::CLASS_WALL, {{0, -2, 0}, {4, 2, 0}, {4, 2, 2.5}, {0, -2, 2.5}}, {-s, s, 0});
  expect("a slanting wall is in the way where it comes into the lane", free_ahead({slanting}), 1.75);
  auto ramp = surface(3, Cluster::CLASS_SLOPE, {{1, -2, 0}, {3, -2, 2}, {3, 2, 2}, {1, 2, 0}}, {-s, 0, s});
  expect("a ramp is where it is no noise of the ground any more", free_ahead({ramp}), 1.15);
  auto stairs_from_below = surface(3, Cluster::CLASS_SLOPE, {{1, -2, 2}, {3, -2, 0}, {3, 2, 0}, {1, 2, 2}}, {s, 0, s});
  expect("stairs from below are where they are as low as the robot is high", free_ahead({stairs_from_below}), 1.8);
}

Cluster doorway(float side, float height) {
  return wall({{2, -3, 0}, {2, -side, 0}, {2, -side, height}, {2, side, height}, {2, side, 0}, {2, 3, 0}, {2, 3, 2.5}, {2, -3, 2.5}});
}

Cluster opening(float side, float bottom, float top) {
  auto around = wall(box(3, 0, 2.5));
  around.holes.emplace_back();
  add_corners({{2, -side, top}, {2, side, top}, {2, side, bottom}, {2, -side, bottom}}, around.holes.back());
  return around;
}

void doors() {
  expect("an open door is free", free_ahead({doorway(0.5, 2.0)}), kFree);
  expect("one that is hardly wider than the robot is", free_ahead({doorway(0.26, 2.0)}), kFree);
  expect("one that is narrower is not", free_ahead({doorway(0.24, 2.0)}), 2.0);
  expect("one whose lintel is low is not", free_ahead({doorway(0.5, 1.1)}), 2.0);
  expect("the robot would meet its side", free_ahead({doorway(0.5, 2.0)}, {0.0, 0.3, 0.1, 0.0}), 2.0);
  expect("the wall beside it is in the way", free_ahead({doorway(0.5, 2.0)}, {0.0, 2.0, 0.1, 0.0}), 2.0);
  expect("a lintel alone is not", free_ahead({wall(box(0.5, 2.0, 2.5))}), kFree);
  expect("a hole from the floor up is free", free_ahead({opening(0.5, 0.08, 2.0)}), kFree);
  expect("a narrow one is not", free_ahead({opening(0.2, 0.08, 2.0)}), 2.0);
  expect("a window is not", free_ahead({opening(0.5, 0.9, 2.0)}), 2.0);
  expect("nor is a wide one", free_ahead({opening(1.5, 0.9, 2.0)}), 2.0);
  expect("nor is a hatch", free_ahead({opening(1.5, 0.08, 1.0)}), 2.0);
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
  known.points(cloud({{1.5, 0.1, 0.4, 0}, {0.7, 0.0, 0.1, 1}, {0.5, 0.4, 0.3, 0}, {1.2, 0.0, 1.5, 0}}));
  expect("what is low is ground", known.free_ahead(ground, kHere), 1.5);
  known.points(cloud({{1.5, 0.1, 0.4, 0}, {0.6, 0.0, 0.3, 1}}));
  expect("what is high is none, though of the ground's cluster, as a ramp is at first", known.free_ahead(ground, kHere), 0.6);
  known.points(cloud({{0.8, 0.0, 0.3, 77}}));
  expect("those of a cluster without an outline are in the way", known.free_ahead(ground, kHere), 0.8);
  known.points(cloud({{1.0, 0.0, 0.7, 2}}));
  expect("and those of one whose outline is that of another part", known.free_ahead(ground, kHere), 1.0);
  sensor_msgs::msg::PointCloud2 empty;  // without fields too
  empty.header.stamp.sec = 7;
  known.points(empty);
  expect("an empty cloud takes them away", known.free_ahead(ground, kHere), 2.0);
  expect("and is the newest", known.voxels_header().stamp.sec == 7);
}

// What is said of a cloud that is none; empty where it is one.
std::string refused_cloud(void (*change)(sensor_msgs::msg::PointCloud2&)) {
  Planner known = planner({});
  auto wrong = cloud({{1.5, 0.1, 0.4, 0}, {0.7, 0.0, 0.1, 1}});
  change(wrong);
  known.points(cloud({{0.8, 0.0, 0.3, 77}}));
  const auto before = known.voxels_header();
  try {
    known.points(wrong);
  } catch (const std::invalid_argument& error) {
    expect("what was there before stays", known.voxels_header() == before && known.free_ahead(level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5), kHere) < 1.0);
    return error.what();
  }
  return "";
}

void clouds_that_are_none() {
  using Cloud = sensor_msgs::msg::PointCloud2;
  expect("one that is one is taken", refused_cloud([](Cloud&) {}).empty());
  expect("so is one with other fields before", refused_cloud([](Cloud& it) {
    for (auto& field : it.fields) field.offset = (field.offset + 4) % 16;
  }).empty());
  const std::string size = "a cloud of labelled points has 31 bytes, of points of 16", x = "a cloud of labelled points of 16 bytes has no 32-bit x";
  expect("a point that is cut off", refused_cloud([](Cloud& it) { it.data.pop_back(); }) == size);
  expect("points of no bytes", !refused_cloud([](Cloud& it) { it.point_step = 0; }).empty());
  expect("a coordinate beyond its point", refused_cloud([](Cloud& it) { it.fields[0].offset = 13; }) == x);
  expect("one that is no float", refused_cloud([](Cloud& it) { it.fields[0].datatype = sensor_msgs::msg::PointField::INT32; }) == x);
  expect("none at all", refused_cloud([](Cloud& it) { it.fields.erase(it.fields.begin()); }) == x);
  expect("bytes the other way round", refused_cloud([](Cloud& it) { it.is_bigendian = true; }) == x);
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

std::vector<Cluster> flight(float first, float up, std::vector<Cluster> clusters = {}) {
  for (int n = 0; n < 4; ++n) {
    clusters.push_back(level(10 + n, Cluster::CLASS_HORIZONTAL, first + up * 0.17f * n, 2.0f + 0.28f * n, 2.28f + 0.28f * n, -1, 1));
  }
  return clusters;
}

void steps() {
  auto floor = level(1, Cluster::CLASS_FLOOR, 0, 1.3, 2, -0.5, 0.5);
  floor.area = 0.5;
  auto known = seen(flight(0.17, 1, {floor}));
  expect("before steps the ground is the floor", known.ground(kHere) && known.ground(kHere)->id == 1);
  expect("the steps are in the way", known.free_ahead(floor, kHere), 2.0);
  expect("a step is no ground before the floor is seen", !seen(flight(0.17, 1)).ground(kHere));
  auto landing = level(1, Cluster::CLASS_FLOOR, 1, -1, 2, -1, 1), lower = level(2, Cluster::CLASS_FLOOR, 0, -5, 9, -5, 5);
  known = seen(flight(0.83, -1, {lower, landing}));
  expect("on a landing it is the landing", known.ground({1.9, 0.0, 1.1, 0.0}) && known.ground({1.9, 0.0, 1.1, 0.0})->id == 1);
  known = seen({lower, level(3, Cluster::CLASS_HORIZONTAL, 0.17, -1, 1, -1, 1)});
  expect("of two that it is over it is the higher", known.ground({0.0, 0.0, 0.27, 0.0})->id == 3);
}

void unseen_ground() {
  expect("the ground may begin ahead", seen({level(1, Cluster::CLASS_FLOOR, 0, 2.4, 4, -1, 1)}).ground(kHere));
  expect("but not far ahead", !seen({level(1, Cluster::CLASS_FLOOR, 0, 2.6, 4, -1, 1)}).ground(kHere));
  auto turned = level(1, Cluster::CLASS_FLOOR, 0, -4, 4, -4, 4);
  turned.holes.emplace_back();
  add_corners({{1.3, 1.3, 0}, {1.3, -1.3, 0}, {-1.3, -1.3, 0}, {-1.3, 1.3, 0}}, turned.holes.back());
  expect("nor is it seen where the robot turned on the spot", seen({turned}).ground(kHere));
  auto fresh = level(2, Cluster::CLASS_HORIZONTAL, 0.05, -1, 1, -1, 1);
  fresh.state = Cluster::STATE_TENTATIVE;
  expect("what is tentative is the ground", seen({fresh}).ground(kHere)->id == 2);
  expect("but where there is another", seen({fresh, turned}).ground(kHere)->id == 1);
}

std::uint64_t ground_of(const std::vector<Cluster>& clusters, const Planner::Robot& robot = kHere) {
  Planner known = seen(clusters);
  const Cluster* ground = known.ground(robot);
  return ground ? ground->id : 0;
}

void floor_that_is_one_with_a_ramp() {
  auto curved = level(1, Cluster::CLASS_CURVED, 0, -3, 4, -2, 2), foot = tilted(2, Cluster::CLASS_HORIZONTAL, 0.04f, 2.2f, 3.2f);
  expect("a ramp's foot has a tilt that a floor may have", ground_of({foot}) == 2);
  expect("it is no ground while something else is under the wheels", ground_of({curved, foot}) == 0);
  expect("on it, it is what the robot stands on", ground_of({curved, foot}, {2.5, 0.0, 0.1, 0.0}) == 2);
  expect("nor where that comes first", ground_of({level(1, Cluster::CLASS_CURVED, 0, 1.3, 4, -2, 2), foot}) == 0);
  expect("nor where a best fit is too high", ground_of({level(1, Cluster::CLASS_CURVED, 0.25, -3, 4, -2, 2), foot}) == 0);
  expect("of two below it a level one is", ground_of({curved, level(3, Cluster::CLASS_FLOOR, 0, -1, 4, -2, 2)}) == 3);
  auto floor = level(3, Cluster::CLASS_FLOOR, 0, 2, 4, -1, 1);
  auto ramp = tilted(1, Cluster::CLASS_SLOPE, 0.3f, 1.3f, 3);
  expect("a ramp that leads up from afar is not at its height", ground_of({ramp, floor}) == 3);
  expect("nor is what is high", ground_of({level(1, Cluster::CLASS_CURVED, 0.5, -3, 4, -2, 2), floor}) == 3);
  expect("nor a wall", ground_of({wall(box(1, 0, 2)), floor}) == 3);
}

// Whether a floor is a ground and a table is one, with other values in their messages.
bool found(float confidence, double turn_about_x, double turn_about_y) {
  auto floor = level(1, Cluster::CLASS_FLOOR, 0, -1, 4, -1, 1), table = level(2, Cluster::CLASS_HORIZONTAL, 0.7f, 1, 2, -0.5, 0.5);
  for (Cluster* each : {&floor, &table}) {
    each->class_confidence = confidence;
    each->plane_covariance[0] = turn_about_x * turn_about_x, each->plane_covariance[4] = turn_about_y * turn_about_y;
  }
  bool is_ground = ground_of({floor}) == 1, is_table = seen({table}).table(floor, 0.75).has_value();
  expect("what is known to be level is so for both", is_ground == is_table);
  return is_ground;
}

void known_to_be_level() {
  expect("ground and table are level", found(0.9f, 0.0, 0.0));
  expect("of floor and raised a half each is enough", found(0.5f, 0.0, 0.0));
  expect("a guess is not", !found(0.2f, 0.0, 0.0));
  expect("their turns are known", found(0.9f, 0.04, 0.04));
  expect("and not hardly", !found(0.9f, 0.06, 0.0) && !found(0.9f, 0.0, 0.06));
  expect("or not at all", !found(0.9f, NAN, NAN));
  expect("a floor may be tilted a little", ground_of({tilted(1, Cluster::CLASS_FLOOR, 0.04f, 0, 4)}) == 1);
  expect("but not more", ground_of({tilted(1, Cluster::CLASS_FLOOR, 0.06f, 0, 4)}) == 0);
  auto floor = level(1, Cluster::CLASS_FLOOR, 0, -1, 4, -1, 1);
  expect("nor a table", !seen({tilted(2, Cluster::CLASS_HORIZONTAL, 0.06f, 1, 3)}).table(floor, 0.75));
}

std_msgs::msg::Header at(double seconds, const char* frame = "odom") {
  std_msgs::msg::Header header;
  header.frame_id = frame;
  header.stamp.sec = static_cast<std::int32_t>(seconds);
  header.stamp.nanosec = static_cast<std::uint32_t>(std::lround(1e9 * (seconds - header.stamp.sec)));
  return header;
}

Freshness::All stamps(std::array<double, 3> seconds) {
  return {{{"map", at(seconds[0]), ""}, {"cloud", at(seconds[1]), "a hint"}, {"pose", at(seconds[2]), ""}}};
}

const std::array<double, 3> kStamps{99.5, 99.8, 99.9};  // of map, voxels and pose

// Why they are not of now; empty where they are.
std::string lack(std::array<double, 3> seconds, double now) {
  auto why = Freshness(1.0).lacks(stamps(seconds), now, 7.0);
  return why ? why->reason : "";
}

void near_the_clock() {
  expect("what came just now is fresh", lack(kStamps, 100.0).empty());
  expect("an old map is not", lack(kStamps, 100.6) == "the map is too old");
  expect("a clock may be a little ahead", lack(kStamps, 99.75).empty());
  expect("but not far", lack(kStamps, 99.65) == "the pose is ahead of the clock");
  expect("nor that of the camera alone", lack({130.0, 130.0, 99.9}, 100.0) == "the map is ahead of the clock");
  expect("without voxels nothing is fresh", lack({99.5, 0.0, 99.9}, 100.0) == "no cloud has come");
  expect("nor without a clock", lack({0.0, 0.0, 0.0}, 0.0) == "no time has come on /clock" && !lack({0.1, 0.1, 0.1}, 0.0).empty());
  expect("no voxels are none when the clock begins", lack({0.1, 0.0, 0.1}, 0.5) == "no cloud has come");
  auto old = Freshness(1.0).lacks(stamps({100.5, 98.5, 100.9}), 101.0, 7.0);
  expect("it says how old, and what to look at", old->numbers == "2.5 s, max_age is 1 s; a hint");
}

void stamps_behind_the_clock() {
  Freshness freshness(1.0);
  auto numbers = [&](double ahead, double steady) {  // the others come each time
    return freshness.lacks(stamps({99.0 + steady / 8, 98.0 + ahead, 99.0 + steady / 8}), 100.5, steady)->numbers;
  };
  expect("one may be the last", numbers(0.0, 7.0) == "2.5 s, max_age is 1 s; a hint");
  expect("where another has come it is the stamps", numbers(0.5, 7.25) == "2 s, max_age is 1 s; it comes, and its stamps are behind the clock");
  expect("until none comes any more", numbers(0.5, 8.5) == "2 s, max_age is 1 s; a hint");
}

void new_by_a_steady_clock() {
  Freshness freshness(1.0);
  expect("it is fresh when it comes", !freshness.lacks(stamps(kStamps), 100.0, 7.0));
  expect("and for a while", !freshness.lacks(stamps(kStamps), 100.0, 7.9));
  auto still = freshness.lacks(stamps(kStamps), 100.0, 8.125);
  expect("but not for ever where the clock stands still", still && still->reason == "no new map comes");
  expect("it says for how long", still->numbers == "for 1.125 s, max_age is 1 s");
  expect("what comes again is fresh", !freshness.lacks(stamps({100.5, 100.8, 100.9}), 101.0, 8.2));
  expect("a new pose is not enough", freshness.lacks(stamps({100.5, 100.8, 100.6}), 100.7, 9.3).has_value());
  expect("all must come", !freshness.lacks(stamps({100.6, 100.6, 100.6}), 100.7, 9.4));
}

std::string refused(void (*change)(Parameters&)) {
  Parameters given;
  change(given);
  return given.impossible();
}

void impossible_parameters() {
  expect("the defaults are possible", refused([](Parameters&) {}).empty());
  expect("a speed of 0 is", refused([](Parameters& p) { p.speed = 0.0; }).empty());
  expect("one cannot stop before one slows down", refused([](Parameters& p) { p.stop_before = 4.0; }) ==
         "slow_from is 1.5 and stop_before is 4; slow_from must be more, for the robot slows down between the two");
  expect("nor where one does", !refused([](Parameters& p) { p.stop_before = p.slow_from; }).empty());
  expect("nothing is below 0", refused([](Parameters& p) { p.speed = -0.3; }) ==
         "speed is -0.3; it must be a finite number and not below 0");
  expect("or endless", refused([](Parameters& p) { p.slow_from = INFINITY; }) ==
         "slow_from is inf; it must be a finite number and not below 0");
  expect("or no number", !refused([](Parameters& p) { p.wished_height = NAN; }).empty());
  expect("a robot has a width", refused([](Parameters& p) { p.width = 0.0; }) == "width is 0; it must be more than 0");
  expect("it is higher than what it drives over", refused([](Parameters& p) { p.height = 0.15; }) ==
         "height is 0.15; it must be more than 0.15");
  expect("nothing is of this very moment", !refused([](Parameters& p) { p.max_age = 0.0; }).empty());
  bool thrown = false;
  try {
    Parameters given;
    given.stop_before = 4.0;
    Driver driver(given);
  } catch (const std::invalid_argument&) {
    thrown = true;
  }
  expect("nobody drives by impossible ones", thrown);
}

void never_faster_towards_an_obstacle() {
  for (double stop_before : {0.0, 0.5, 1.4999}) {
    Parameters given;
    given.stop_before = stop_before;
    Driver driver(given);
    double before = 0.0;
    for (double free = 0.0; free < 5.0; free += 0.01) {
      auto [speed, why] = driver.before(free);
      expect("it is not faster nearer to an obstacle", speed >= before && speed <= given.speed);
      expect("it stands before one, and says so", (free <= stop_before) == (speed == 0.0) && why.has_value() == (speed == 0.0));
      before = speed;
    }
    expect("far from any it has its speed", driver.before(kFree).value, given.speed);
  }
}

// Why a robot stands to whom this has come, at 100 s; empty where it drives.
std::string stands(Driver& driver, double base_height, double now = 100.0, const std::string& slash = "") {
  tf2_msgs::msg::TFMessage message;
  message.transforms.emplace_back();
  auto& transform = message.transforms.back();
  transform.header = at(100.0, (slash + "odom").c_str()), transform.child_frame_id = slash + "base_link";
  transform.transform.translation.z = base_height, transform.transform.rotation.w = 1.0;
  driver.transforms(message);
  auto why = driver.speed(now, 7.0).why;
  return why ? why->reason : "";
}

void snapshot(Driver& driver, std::uint64_t sequence, const std::vector<Cluster>& clusters, std::uint64_t session_id = 1) {
  MapReader::Array map;
  map.header = at(100.0), map.session_id = session_id, map.sequence = sequence;
  map.clusters.assign(clusters.begin(), clusters.end());
  driver.planner.map.snapshot(map);
}

void why_it_stands() {
  Driver driver{Parameters()};
  expect("there is no map", driver.speed(100.0, 7.0).why->reason == "no map has come");
  snapshot(driver, 1, {level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5)});
  auto why = driver.speed(100.0, 7.0).why;
  expect("there are no points", why->reason == "no cloud of labelled points has come");
  expect("it says what to look at", why->numbers.find("net.core.rmem_default") != std::string::npos);
  sensor_msgs::msg::PointCloud2 none;
  none.header = at(100.0);
  driver.planner.points(none);
  expect("there is no pose", driver.speed(100.0, 7.0).why->reason == "no transform from `odom` straight to `base_link` has come");
  expect("it drives where all is there", stands(driver, 0.1).empty());
  expect("the map is old", stands(driver, 0.1, 101.5) == "the map is too old");
  expect("there is no floor", stands(driver, 3.0) == "no floor is seen below the robot or up to 2.5 m ahead");
  snapshot(driver, 2, {level(1, Cluster::CLASS_CURVED, 0, -5, 5, -5, 5)});
  expect("it is not level", stands(driver, 0.1) == "what is below the robot or first ahead is not known to be level");
  why = driver.speed(100.0, 7.0).why;
  expect("it says which", why->numbers == "cluster 1: class 6, confidence 0.9, rises by 0 m/m, which is known to 0");
  auto near = surface(2, Cluster::CLASS_WALL, {{0.25, -3, 0}, {0.25, 3, 0}, {0.25, 3, 2}, {0.25, -3, 2}}, {-1, 0, 0});
  snapshot(driver, 3, {level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5), near});
  expect("a wall is near", stands(driver, 0.1) == "an obstacle is ahead");
  expect("it says how near", driver.speed(100.0, 7.0).why->numbers == "0.25 m from the base frame, stop_before is 0.5 m");
}

void what_does_not_belong_together() {
  Driver driver{Parameters()};
  auto floor = level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5);
  snapshot(driver, 1, {floor});
  sensor_msgs::msg::PointCloud2 none;
  none.header = at(100.0, "map");
  driver.planner.points(none);
  expect("the points are elsewhere", stands(driver, 0.1) == "map and labelled points are in different frames");
  none.header = at(100.0);
  driver.planner.points(none);
  expect("it drives by what belongs together", stands(driver, 0.1).empty());
  snapshot(driver, 2, {floor}, 2);
  expect("another session is not its own", stands(driver, 0.1) == "a new session has begun, which may know nothing of what was seen before");
}

void what_is_no_place() {
  Driver driver{Parameters()};
  snapshot(driver, 1, {level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5)});
  sensor_msgs::msg::PointCloud2 none;
  none.header = at(100.0);
  driver.planner.points(none);
  expect("it drives from a place", stands(driver, 0.1).empty());
  const double nan = std::numeric_limits<double>::quiet_NaN(), places[][3] = {{nan, 0, 1}, {0, nan, 1}, {0, 0, nan}, {0, 0, 0}, {0, 0, 1.02}};
  for (const auto& [x, z, w] : places) {
    tf2_msgs::msg::TFMessage message;
    message.transforms.emplace_back();
    auto& transform = message.transforms.back();
    transform.header = at(100.0, "odom"), transform.child_frame_id = "base_link";
    transform.transform.translation.x = x, transform.transform.translation.z = z, transform.transform.rotation.w = w;
    driver.transforms(message);
    auto speed = driver.speed(100.0, 7.0);
    expect("it stands where that is none", speed.value == 0.0 && speed.why && speed.why->reason == "the robot's transform is no place");
  }
}

void slashes_of_ros_1() {
  Parameters given;
  given.base_frame = "/base_link";
  Driver driver{given};
  snapshot(driver, 1, {level(1, Cluster::CLASS_FLOOR, 0, -5, 5, -5, 5)});
  sensor_msgs::msg::PointCloud2 none;
  none.header = at(100.0);
  driver.planner.points(none);
  expect("names of frames may have a slash", stands(driver, 0.1, 100.0, "/").empty());
}

void when_it_says_so() {
  Standing standing;
  const Why map{"no map has come", ""}, near{"an obstacle is ahead", "0.3 m"}, nearer{"an obstacle is ahead", "0.2 m"};
  expect("it says why at once", standing.line(map, 1.0).value() == "the robot stands: no map has come");
  expect("not again and again", !standing.line(map, 1.1) && !standing.line(map, 5.9));
  expect("but every 5 s", standing.line(map, 6.0).has_value());
  expect("a new reason comes a second later at the earliest", !standing.line(near, 6.1));
  expect("with its numbers", standing.line(near, 7.0).value() == "the robot stands: an obstacle is ahead (0.3 m)");
  expect("other numbers are no other reason", !standing.line(nearer, 8.5));
  expect("nothing is said while it drives", !standing.line(std::nullopt, 9.0));
  expect("after that the same is new", standing.line(nearer, 9.1).has_value());
}

int main() {
  near_the_clock();
  stamps_behind_the_clock();
  new_by_a_steady_clock();
  impossible_parameters();
  never_faster_towards_an_obstacle();
  why_it_stands();
  what_does_not_belong_together();
  what_is_no_place();
  slashes_of_ros_1();
  when_it_says_so();
  outlines();
  within_outlines();
  doors();
  steps();
  unseen_ground();
  floor_that_is_one_with_a_ramp();
  known_to_be_level();
  voxels();
  clouds_that_are_none();
  ground_and_table();
}
