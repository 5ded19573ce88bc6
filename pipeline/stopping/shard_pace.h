#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>

#include "pipeline/stopping/stop_order.h"

namespace eventgan {

/// How fast a run gets on, told by its writer and asked by others. Thread safe.
class ShardPace {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  /// The run starts now, with `threads` samples at work at a time. `clock` is for tests.
  explicit ShardPace(int threads, Clock clock = std::chrono::steady_clock::now);

  /// The writer opened a shard of `samples` samples.
  void open(int samples);
  /// It took a sample whose chunk has so many bytes.
  void take(std::int64_t bytes);
  /// It begins to commit the shard.
  void begin_commit();
  /// The shard is committed, or given up.
  void close();

  /// The open shard; a sample that keeps the run waiting counts from now on.
  std::optional<OpenShard> open_shard() const;

 private:
  double seconds_since(std::chrono::steady_clock::time_point start) const;
  double commit_seconds() const;

  mutable std::mutex mutex_;
  int threads_;
  Clock clock_;
  std::chrono::steady_clock::time_point start_;
  std::int64_t taken_ = 0;  // of the run
  bool is_open_ = false;
  int samples_ = 0;  // of the open shard
  int samples_taken_ = 0;
  std::int64_t bytes_ = 0;
  std::optional<std::chrono::steady_clock::time_point> commit_start_;
  std::optional<double> last_commit_s_;
};

}  // namespace eventgan
