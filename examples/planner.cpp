// Keeps clear of obstacles and finds the table, as examples/planner.py does: the node around planner.hpp.
// Depends on rclcpp, cfodi_msgs, geometry_msgs, sensor_msgs and tf2_msgs.
#include <chrono>
#include <cmath>
#include <map>
#include <memory>
#include <string>
#include <tuple>

#include <geometry_msgs/msg/twist.hpp>
#include <rclcpp/rclcpp.hpp>
#include <tf2_msgs/msg/tf_message.hpp>

#include "planner.hpp"

class PlannerNode : public rclcpp::Node {
 public:
  PlannerNode() : Node("planner"), planner_(declare_parameter("width", 0.5), declare_parameter("height", 1.2)) {
    using Array = MapReader::Array;
    auto frame = declare_parameter<std::string>("base_frame", "base_link");
    clusters_ = create_subscription<Array>(
        "/cfodi/clusters", rclcpp::QoS(1).transient_local(), [this](const Array& message) { planner_.map.snapshot(message); });
    deltas_ = create_subscription<Array>(
        "/cfodi/clusters_delta", 20, [this](const Array& message) { planner_.map.delta(message); });
    points_ = create_subscription<sensor_msgs::msg::PointCloud2>(
        "/cfodi/points_labelled", rclcpp::SensorDataQoS(),
        [this](const sensor_msgs::msg::PointCloud2& cloud) { planner_.points(cloud); });
    transforms_ = create_subscription<tf2_msgs::msg::TFMessage>("/tf", 100, [this, frame](const tf2_msgs::msg::TFMessage& message) {
      for (const auto& transform : message.transforms) {
        if (transform.child_frame_id == frame) poses_[transform.header.frame_id] = transform;
      }
    });
    commands_ = create_publisher<geometry_msgs::msg::Twist>("cmd_vel", 1);
    timer_ = create_wall_timer(std::chrono::milliseconds(100), [this] {
      geometry_msgs::msg::Twist command;
      command.linear.x = speed();
      commands_->publish(command);
    });
  }

 private:
  double speed() {
    const auto& map = planner_.map.header();
    auto pose = poses_.find(map.frame_id);
    std::chrono::duration<double> steady = std::chrono::steady_clock::now().time_since_epoch();
    Freshness::Headers seen{map, planner_.voxels_header(), pose == poses_.end() ? std_msgs::msg::Header() : pose->second.header};
    // A robot that sees nothing, or does not know where it is, stands.
    if (!freshness_.holds(seen, now().seconds(), steady.count()) || pose == poses_.end()) return 0.0;
    const auto& at = pose->second.transform.translation;
    const auto& q = pose->second.transform.rotation;
    Planner::Robot robot{at.x, at.y, at.z, std::atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))};
    const auto* ground = planner_.ground(robot);
    if (!ground) return 0.0;
    if (auto table = planner_.table(*ground, wished_height_)) {
      const auto& [p, size] = std::tie(table->cluster->pose.position, table->cluster->size);
      RCLCPP_INFO_THROTTLE(get_logger(), *get_clock(), 1000, "table: %.2f m high, %.2f x %.2f m, its middle at (%.2f, %.2f, %.2f)",
                           table->height, size.x, size.y, p.x, p.y, p.z);
    }
    return speed_ * std::clamp((planner_.free_ahead(*ground, robot) - stop_before_) / (slow_from_ - stop_before_), 0.0, 1.0);
  }

  Planner planner_;
  double wished_height_ = declare_parameter("wished_height", 0.75), speed_ = declare_parameter("speed", 0.3);
  double stop_before_ = declare_parameter("stop_before", 0.5), slow_from_ = declare_parameter("slow_from", 1.5);
  Freshness freshness_{declare_parameter("max_age", 1.0)};
  std::map<std::string, geometry_msgs::msg::TransformStamped> poses_;
  rclcpp::Subscription<MapReader::Array>::SharedPtr clusters_, deltas_;
  rclcpp::Subscription<sensor_msgs::msg::PointCloud2>::SharedPtr points_;
  rclcpp::Subscription<tf2_msgs::msg::TFMessage>::SharedPtr transforms_;
  rclcpp::Publisher<geometry_msgs::msg::Twist>::SharedPtr commands_;
  rclcpp::TimerBase::SharedPtr timer_;
};

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<PlannerNode>());
  rclcpp::shutdown();
}
