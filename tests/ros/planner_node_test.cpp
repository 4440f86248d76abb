// The node in C++ against the stand-in of rclcpp: what it refuses, what it says, and how it ends.
#define main planner_main
#include "planner.cpp"
#undef main

#include <any>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

using geometry_msgs::msg::Twist;

void expect(const char* sentence, bool holds) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", sentence);
  for (const auto& line : rclcpp::stand_in().log) std::fprintf(stderr, "  it said: %s\n", line.c_str());
  std::exit(1);
}

bool said(const std::string& what) {
  for (const auto& line : rclcpp::stand_in().log) {
    if (line.find(what) != std::string::npos) return true;
  }
  return false;
}

// Its exit status; `turn` comes before each command.
int run(const std::map<std::string, std::any>& parameters, const std::function<void()>& turn) {
  rclcpp::stand_in() = {};
  rclcpp::stand_in().parameters = parameters;
  rclcpp::stand_in().turn = turn;
  ended = 0;
  char name[] = "planner";
  char* arguments[] = {name, nullptr};
  return planner_main(1, arguments);
}

const std::vector<Twist>& commands() { return rclcpp::published<Twist>("cmd_vel"); }

std_msgs::msg::Header now(const char* frame) {
  auto since = std::chrono::system_clock::now().time_since_epoch();
  auto whole = std::chrono::duration_cast<std::chrono::seconds>(since);
  std_msgs::msg::Header header;
  header.frame_id = frame;
  header.stamp.sec = static_cast<std::int32_t>(whole.count());
  header.stamp.nanosec = static_cast<std::uint32_t>(std::chrono::nanoseconds(since - whole).count());
  return header;
}

// A map with a floor of 10 m by 10 m, no voxel, and the robot in its middle.
void see_a_floor() {
  MapReader::Array map;
  map.header = now("odom");
  map.session_id = 1, map.sequence = commands().size() + 1;
  map.clusters.emplace_back();
  auto& floor = map.clusters.back();
  floor.id = 1, floor.surface_class = Planner::Cluster::CLASS_FLOOR, floor.class_confidence = 0.9f;
  floor.state = Planner::Cluster::STATE_ACTIVE;
  floor.plane.coef = {0, 0, 1, 0};
  for (auto [x, y] : {std::pair{-5.0f, -5.0f}, {5.0f, -5.0f}, {5.0f, 5.0f}, {-5.0f, 5.0f}}) {
    floor.boundary.points.emplace_back();
    floor.boundary.points.back().x = x, floor.boundary.points.back().y = y;
  }
  rclcpp::send("/cfodi/clusters", map);
  sensor_msgs::msg::PointCloud2 none;
  none.header = map.header;
  rclcpp::send("/cfodi/points_labelled", none);
  tf2_msgs::msg::TFMessage transforms;
  transforms.transforms.emplace_back();
  transforms.transforms.back().header = map.header, transforms.transforms.back().child_frame_id = "base_link";
  transforms.transforms.back().transform.rotation.w = 1.0;
  rclcpp::send("/tf", transforms);
}

void impossible_parameters_end_it() {
  auto never = [] { expect("it does not drive by impossible parameters", false); };
  expect("it does not end with 0", run({{"stop_before", 4.0}}, never) != 0);
  expect("it says the numbers", said("slow_from is 1.5 and stop_before is 4; slow_from must be more"));
  expect("nothing is published", rclcpp::stand_in().published.empty());
  expect("a number that is none is refused", run({{"speed", std::nan("")}}, never) != 0 && said("speed is nan"));
  expect("so is a parameter of another type", run({{"speed", 1}}, never) != 0 && !rclcpp::stand_in().log.empty());
}

void a_signal_stops_the_robot(int signal) {
  int status = run({}, [signal] {
    see_a_floor();
    if (commands().size() == 3) std::raise(signal);
  });
  expect("it ends with 0", status == 0);
  expect("it has driven", commands().size() > 3 && commands()[2].linear.x == 0.3);
  expect("its last command is a stop", commands().back().linear.x == 0.0 && commands().back().angular.z == 0.0);
  expect("rclcpp has no handler that would shut down first", !rclcpp::stand_in().signals);
  expect("rclcpp is shut down at the end", !rclcpp::ok());
}

void an_error_stops_the_robot() {
  bool thrown = false;
  try {
    run({}, [] {
      see_a_floor();
      if (commands().size() == 3) throw std::runtime_error("as a callback may");
    });
  } catch (const std::runtime_error&) {
    thrown = true;
  }
  expect("the error is not hidden", thrown);
  expect("the last command is a stop all the same", commands().size() == 4 && commands().back().linear.x == 0.0);
}

void it_says_why_it_stands() {
  auto end_soon = [] {
    if (commands().size() == 3) std::raise(SIGTERM);
  };
  run({}, end_soon);
  expect("without a map it says so", said("the robot stands: no map has come"));
  expect("and once", rclcpp::stand_in().log.size() == 1);
  for (const auto& command : commands()) expect("and it stands", command.linear.x == 0.0);
  run({{"speed", 0.0}}, [end_soon] {
    see_a_floor();
    end_soon();
  });
  expect("it says that it only looks", said("the robot stands: the parameter speed is 0"));
  for (const auto& command : commands()) expect("and does", command.linear.x == 0.0);
}

int main() {
  impossible_parameters_end_it();
  a_signal_stops_the_robot(SIGINT);
  a_signal_stops_the_robot(SIGTERM);
  an_error_stops_the_robot();
  it_says_why_it_stands();
}
