// Keeps clear of obstacles and finds the table, as examples/planner.py does: the node around planner.hpp.
// Depends on rclcpp, cfodi_msgs, geometry_msgs, sensor_msgs and tf2_msgs.
#include <chrono>
#include <csignal>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <tuple>

#include <geometry_msgs/msg/twist.hpp>
#include <rclcpp/rclcpp.hpp>
#include <tf2_msgs/msg/tf_message.hpp>

#include "planner.hpp"

class PlannerNode : public rclcpp::Node {
 public:
  PlannerNode() : Node("planner"), driver_(parameters()) {
    using Array = MapReader::Array;
    clusters_ = create_subscription<Array>("/cfodi/clusters", rclcpp::QoS(1).transient_local(),
                                           [this](const Array& message) { driver_.planner.map.snapshot(message); });
    deltas_ = create_subscription<Array>(
        "/cfodi/clusters_delta", 20, [this](const Array& message) { driver_.planner.map.delta(message); });
    points_ = create_subscription<sensor_msgs::msg::PointCloud2>(
        "/cfodi/points_labelled", rclcpp::SensorDataQoS(),
        [this](const sensor_msgs::msg::PointCloud2& cloud) { driver_.planner.points(cloud); });
    transforms_ = create_subscription<tf2_msgs::msg::TFMessage>(
        "/tf", 100, [this](const tf2_msgs::msg::TFMessage& message) { driver_.transforms(message); });
    commands_ = create_publisher<geometry_msgs::msg::Twist>("cmd_vel", 1);
    timer_ = create_wall_timer(std::chrono::milliseconds(100), [this] { command(); });
  }

  // The last command, for a base may keep it.
  void stop() {
    commands_->publish(geometry_msgs::msg::Twist());
    std::this_thread::sleep_for(std::chrono::milliseconds(200));  // the middleware sends it, and again where it was lost
  }

 private:
  Parameters parameters() {
    Parameters given;
    given.base_frame = declare_parameter<std::string>("base_frame", given.base_frame);
    auto declare = [this](const char* name, double& value) { value = declare_parameter(name, value); };
    declare("width", given.width), declare("height", given.height), declare("wished_height", given.wished_height);
    declare("speed", given.speed), declare("stop_before", given.stop_before), declare("slow_from", given.slow_from);
    declare("max_age", given.max_age);
    return given;
  }

  void command() {
    std::chrono::duration<double> steady = std::chrono::steady_clock::now().time_since_epoch();
    auto [speed, why] = driver_.speed(now().seconds(), steady.count());
    geometry_msgs::msg::Twist command;
    command.linear.x = speed;
    commands_->publish(command);
    if (auto line = standing_.line(why, steady.count())) RCLCPP_INFO(get_logger(), "%s", line->c_str());
    if (const auto& table = driver_.table) {
      const auto& [p, size] = std::tie(table->cluster->pose.position, table->cluster->size);
      RCLCPP_INFO_THROTTLE(get_logger(), *get_clock(), 1000, "table: %.2f m high, %.2f x %.2f m, its middle at (%.2f, %.2f, %.2f)",
                           table->height, size.x, size.y, p.x, p.y, p.z);
    }
  }

  Driver driver_;
  Standing standing_;
  rclcpp::Subscription<MapReader::Array>::SharedPtr clusters_, deltas_;
  rclcpp::Subscription<sensor_msgs::msg::PointCloud2>::SharedPtr points_;
  rclcpp::Subscription<tf2_msgs::msg::TFMessage>::SharedPtr transforms_;
  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr commands_;
  rclcpp::TimerBase::SharedPtr timer_;
};

volatile std::sig_atomic_t ended = 0;

// Until a signal comes; whatever ends it, the robot stops.
void drive(const std::shared_ptr<PlannerNode>& node) {
  rclcpp::executors::SingleThreadedExecutor executor;
  executor.add_node(node);
  try {
    while (rclcpp::ok() && !ended) executor.spin_once(std::chrono::milliseconds(100));
  } catch (...) {
    node->stop();
    throw;
  }
  node->stop();
}

int main(int argc, char** argv) {
  for (int each : {SIGINT, SIGTERM}) std::signal(each, [](int) { ended = 1; });
  // Its own handlers shut ROS down at once, and no stop could be sent.
  rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
  std::shared_ptr<PlannerNode> node;
  try {
    node = std::make_shared<PlannerNode>();
  } catch (const std::exception& error) {  // parameters that are impossible, or of another type
    RCLCPP_FATAL(rclcpp::get_logger("planner"), "%s", error.what());
    rclcpp::shutdown();
    return 2;
  }
  drive(node);
  rclcpp::shutdown();
  return 0;
}
