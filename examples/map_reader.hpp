// Keeps the map of surfaces that cfodi publishes. Copy it into a node and feed it from two subscriptions:
// `~/clusters` (reliable, transient local, depth 1) to snapshot(), `~/clusters_delta` (reliable, depth 20) to delta().
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <utility>

#include <cfodi_msgs/msg/surface_cluster_array.hpp>

// Snapshots and deltas come on two topics, in no common order: deltas wait here until a snapshot fits under them.
class MapReader {
 public:
  using Array = cfodi_msgs::msg::SurfaceClusterArray;

  static constexpr double kBack = 1.0;  // a snapshot of a recording that is played again has a stamp more than this before the map's [s]

  explicit MapReader(std::size_t most_deltas = 1000) : most_deltas_(most_deltas) {}

  void snapshot(const Array& message) {
    auto before = std::exchange(newest_, message.sequence);
    if (version_ && message.session_id == session_id_) {
      // Snapshots come in their order, late and seldom as they may be: where they go back, a recording is played again.
      if (message.sequence < before && seconds(header_) - seconds(message.header) > kBack) {
        deltas_.clear();  // of the time before
      } else if (message.sequence <= *version_) {
        return;  // the deltas were faster
      }
    }
    session_id_ = message.session_id;  // ids mean nothing beyond their session
    version_ = message.sequence;
    header_ = message.header;
    clusters_.clear();
    for (const auto& cluster : message.clusters) clusters_[cluster.id] = cluster;
    catch_up();
  }

  void delta(const Array& message) {
    deltas_.push_back(message);
    if (deltas_.size() > most_deltas_) deltas_.pop_front();
    catch_up();
  }

  const std::map<std::uint64_t, cfodi_msgs::msg::SurfaceCluster>& clusters() const { return clusters_; }
  std::optional<std::uint64_t> version() const { return version_; }  // `sequence` of the map; none before a snapshot
  std::uint64_t session_id() const { return session_id_; }
  const std_msgs::msg::Header& header() const { return header_; }  // frame of the map, stamp of the newest scan in it

 private:
  static double seconds(const std_msgs::msg::Header& header) { return header.stamp.sec + 1e-9 * header.stamp.nanosec; }

  void catch_up() {
    std::deque<Array> waiting = std::exchange(deltas_, {});
    for (auto& message : waiting) {
      if (!version_ || message.session_id != session_id_ || message.base_sequence > *version_) {
        deltas_.push_back(std::move(message));  // of a session, or after a gap, that the next snapshot will cover
      } else if (message.base_sequence == *version_) {
        for (auto gone : message.removed) clusters_.erase(gone);
        for (const auto& cluster : message.clusters) clusters_[cluster.id] = cluster;
        version_ = message.sequence;
        header_ = message.header;
      }
    }
  }

  std::uint64_t session_id_ = 0;
  std::optional<std::uint64_t> version_;
  std::uint64_t newest_ = 0;  // `sequence` of the newest snapshot, taken or not
  std_msgs::msg::Header header_;
  std::map<std::uint64_t, cfodi_msgs::msg::SurfaceCluster> clusters_;
  std::deque<Array> deltas_;
  std::size_t most_deltas_;
};
