#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

namespace eventgan {

/// What a conversion does, by whether it was asked to stop.
enum class StopOrder {
  kGoOn,
  kFinishShard,  ///< finish the shard that is being written, start no other
  kAbort         ///< drop the shard under way and end
};

/// What is left to do of the shard that is being written.
struct WorkLeft {
  int samples = 0;
  double seconds_per_sample = 0;  ///< wall time, of the run so far
  double commit_seconds = 0;      ///< what the commit will take, by the last one
  double abort_seconds = 0;       ///< what an abort takes: a sample at work is not interrupted
};

/// After a request `since_request_s` seconds ago (none: no request): finishes the open shard if by
/// its rate it will be committed within `grace_s` seconds of the request, with one sample's time
/// and an abort's to spare; else aborts. Aborts if no shard is open (`left` is none). Asked again
/// and again, it turns to kAbort when the shard proves slower than thought, while there is still
/// time for that.
StopOrder stop_order(std::optional<double> since_request_s, double grace_s,
                     const std::optional<WorkLeft>& left);

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

  /// Of the open shard; none if no shard is open. A sample that keeps the run waiting counts from
  /// now on.
  std::optional<WorkLeft> work_left() const;

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

/// Turns a request to stop into orders while it lives: asks whenever its order is asked for, and
/// some fifty times a second, also when nothing else moves. Orders only get stricter.
class StopMonitor {
 public:
  using SinceRequest = std::function<std::optional<double>()>;  ///< StopSignal's, say
  using Left = std::function<std::optional<WorkLeft>()>;        ///< ShardPace's, say

  /// Both functions are called from other threads, too; they must be thread safe and not throw.
  /// Without `since_request` the order is always kGoOn. The first order holds on return.
  StopMonitor(SinceRequest since_request, double grace_s, Left left);
  ~StopMonitor();

  /// Thread safe, and cheap enough to ask for every sample.
  StopOrder order() const;

 private:
  SinceRequest since_request_;
  double grace_s_;
  Left left_;
  mutable std::atomic<StopOrder> order_{StopOrder::kGoOn};
  std::jthread thread_;  // last, so that it ends first
};

/// While it lives, SIGINT, SIGTERM and SIGUSR1 (what schedulers send ahead of a time limit) ask to
/// stop instead of ending the process. A second SIGINT ends it at once; further SIGTERM and SIGUSR1
/// change nothing, since schedulers repeat them. At most one at a time.
class StopSignal {
 public:
  /// `told`: what the first SIGINT writes to the standard error stream at once, before anybody has
  /// looked at the request.
  explicit StopSignal(std::string told = "");
  ~StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  /// Whether a signal has come. Thread safe.
  bool requested() const;

  /// Seconds since the first one; none if none has come. Thread safe.
  std::optional<double> seconds_since_request() const;

 private:
  std::array<struct sigaction, 3> before_{};
};

}  // namespace eventgan
