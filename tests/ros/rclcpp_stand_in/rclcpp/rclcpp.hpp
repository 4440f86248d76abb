// What examples/planner.cpp uses of rclcpp, declared as Jazzy declares it and without a body: rclcpp is not among the Python
// packages that the tests can have. It shows that the example is C++ and uses the messages rightly, and no more.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

namespace rclcpp {

class Time {
 public:
  double seconds() const;
};

class Clock {};

class QoS {
 public:
  QoS(std::size_t depth);
  QoS& transient_local();
};

class SensorDataQoS : public QoS {
 public:
  SensorDataQoS();
};

template <typename Message>
class Subscription {
 public:
  using SharedPtr = std::shared_ptr<Subscription>;
};

template <typename Message>
class Publisher {
 public:
  using SharedPtr = std::shared_ptr<Publisher>;
  void publish(const Message& message);
};

class TimerBase {
 public:
  using SharedPtr = std::shared_ptr<TimerBase>;
};

class Logger {};

class Node {
 public:
  explicit Node(const std::string& name);
  template <typename Value>
  Value declare_parameter(const std::string& name, const Value& default_value);
  template <typename Message>
  std::shared_ptr<Subscription<Message>> create_subscription(
      const std::string& topic, const QoS& qos, std::function<void(const Message&)> callback);
  template <typename Message>
  std::shared_ptr<Publisher<Message>> create_publisher(const std::string& topic, const QoS& qos);
  std::shared_ptr<TimerBase> create_wall_timer(std::chrono::milliseconds period, std::function<void()> callback);
  Time now() const;
  std::shared_ptr<Clock> get_clock();
  Logger get_logger() const;
};

void log(const Logger& logger, const Clock& clock, int milliseconds, const char* format, ...) __attribute__((format(printf, 4, 5)));
void init(int argc, char** argv);
void spin(std::shared_ptr<Node> node);
bool shutdown();

}  // namespace rclcpp

#define RCLCPP_INFO_THROTTLE(logger, clock, milliseconds, ...) rclcpp::log(logger, clock, milliseconds, __VA_ARGS__)
