// What examples/planner.cpp uses of rclcpp, declared as Jazzy declares it, for rclcpp is not among the Python packages that the
// tests can have. Its bodies are of one process without a network: what is published is kept, messages come from the test, and a
// turn of the executor calls every timer. It shows that the example is C++, and what it does with what comes; no more.
#pragma once

#include <any>
#include <chrono>
#include <cstdarg>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

namespace rclcpp {

// What a test gives to the node, and what it finds.
struct StandIn {
  std::map<std::string, std::any> parameters;  // other values than the defaults
  std::function<void()> turn;  // comes before the timers
  std::map<std::string, std::any> subscriptions, published;  // by topic: a std::function of a message, a std::vector of them
  std::vector<std::string> log;
  bool up = false, signals = false;  // whether the context is, and whether a signal would end it
};

inline StandIn& stand_in() {
  static StandIn only;
  return only;
}

template <typename Message>
void send(const std::string& topic, const Message& message) {
  std::any_cast<std::function<void(const Message&)>&>(stand_in().subscriptions.at(topic))(message);
}

template <typename Message>
const std::vector<Message>& published(const std::string& topic) {
  return std::any_cast<const std::vector<Message>&>(stand_in().published.at(topic));
}

class Time {
 public:
  explicit Time(double seconds) : seconds_(seconds) {}
  double seconds() const { return seconds_; }

 private:
  double seconds_;
};

class Clock {};

class QoS {
 public:
  QoS(std::size_t) {}
  QoS& transient_local() { return *this; }
};

class SensorDataQoS : public QoS {
 public:
  SensorDataQoS() : QoS(5) {}
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
  explicit Publisher(const std::string& topic) : topic_(topic) { stand_in().published[topic] = std::vector<Message>(); }

  // Nothing goes out after a shutdown, without an error, as it is in rclcpp.
  void publish(const Message& message) {
    if (stand_in().up) std::any_cast<std::vector<Message>&>(stand_in().published.at(topic_)).push_back(message);
  }

 private:
  std::string topic_;
};

class TimerBase {
 public:
  using SharedPtr = std::shared_ptr<TimerBase>;
  std::function<void()> callback;
};

class Logger {};

class Node {
 public:
  explicit Node(const std::string&) {}

  template <typename Value>
  Value declare_parameter(const std::string& name, const Value& default_value) {
    auto given = stand_in().parameters.find(name);
    if (given == stand_in().parameters.end()) return default_value;
    return std::any_cast<Value>(given->second);  // throws where it is of another type, as Jazzy does
  }

  template <typename Message>
  std::shared_ptr<Subscription<Message>> create_subscription(
      const std::string& topic, const QoS&, std::function<void(const Message&)> callback) {
    stand_in().subscriptions[topic] = callback;
    return std::make_shared<Subscription<Message>>();
  }

  template <typename Message>
  std::shared_ptr<Publisher<Message>> create_publisher(const std::string& topic, const QoS&) {
    return std::make_shared<Publisher<Message>>(topic);
  }

  std::shared_ptr<TimerBase> create_wall_timer(std::chrono::milliseconds, std::function<void()> callback) {
    timers_.push_back(std::make_shared<TimerBase>());
    timers_.back()->callback = callback;
    return timers_.back();
  }

  Time now() const {
    return Time(std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count());
  }

  std::shared_ptr<Clock> get_clock() { return std::make_shared<Clock>(); }
  Logger get_logger() const { return {}; }

  void call_timers() const {
    for (const auto& timer : timers_) timer->callback();
  }

 private:
  std::vector<std::shared_ptr<TimerBase>> timers_;
};

namespace executors {

class SingleThreadedExecutor {
 public:
  void add_node(std::shared_ptr<Node> node) { node_ = node; }

  void spin_once(std::chrono::nanoseconds = std::chrono::nanoseconds(-1)) {
    if (stand_in().turn) stand_in().turn();
    if (auto node = node_.lock()) node->call_timers();
  }

 private:
  std::weak_ptr<Node> node_;
};

}  // namespace executors

class InitOptions {};

enum class SignalHandlerOptions { All, SigInt, SigTerm, None };

inline void init(int, char const* const[], const InitOptions& = {}, SignalHandlerOptions signals = SignalHandlerOptions::All) {
  stand_in().up = true, stand_in().signals = signals != SignalHandlerOptions::None;
}

inline bool ok() { return stand_in().up; }

inline bool shutdown() {
  bool before = stand_in().up;
  stand_in().up = false;
  return before;
}

inline Logger get_logger(const std::string&) { return {}; }

__attribute__((format(printf, 2, 3))) inline void log(const Logger&, const char* format, ...) {
  char line[1000];
  std::va_list values;
  va_start(values, format);
  std::vsnprintf(line, sizeof line, format, values);
  va_end(values);
  stand_in().log.push_back(line);
}

}  // namespace rclcpp

#define RCLCPP_INFO(logger, ...) rclcpp::log(logger, __VA_ARGS__)
#define RCLCPP_FATAL(logger, ...) rclcpp::log(logger, __VA_ARGS__)
#define RCLCPP_INFO_THROTTLE(logger, clock, milliseconds, ...) \
  (static_cast<void>(static_cast<rclcpp::Clock&>(clock)), static_cast<void>(milliseconds), rclcpp::log(logger, __VA_ARGS__))
