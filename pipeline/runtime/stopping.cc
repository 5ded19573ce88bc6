#include "pipeline/runtime/stopping.h"

#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <utility>

namespace eventgan {
namespace {

/// Flushing and hashing before the first commit was measured: a slow disk.
constexpr double kAssumedBytesPerSecond = 100e6;

/// Of a monitor's looks.
constexpr std::chrono::milliseconds kInterval{20};

}  // namespace

StopOrder stop_order(std::optional<double> since_request_s, double grace_s,
                     const std::optional<WorkLeft>& left) {
  if (!since_request_s) return StopOrder::kGoOn;
  if (!left) return StopOrder::kAbort;
  const double end_s =
      *since_request_s + (left->samples + 1) * left->seconds_per_sample + left->commit_seconds;
  return end_s + left->abort_seconds <= grace_s ? StopOrder::kFinishShard : StopOrder::kAbort;
}

ShardPace::ShardPace(int threads, Clock clock)
    : threads_(threads), clock_(std::move(clock)), start_(clock_()) {}

void ShardPace::open(int samples) {
  const std::lock_guard lock(mutex_);
  is_open_ = true;
  samples_ = samples;
  samples_taken_ = 0;
  bytes_ = 0;
}

void ShardPace::take(std::int64_t bytes) {
  const std::lock_guard lock(mutex_);
  ++taken_;
  ++samples_taken_;
  bytes_ += bytes;
}

void ShardPace::begin_commit() {
  const std::lock_guard lock(mutex_);
  commit_start_ = clock_();
}

void ShardPace::close() {
  const std::lock_guard lock(mutex_);
  is_open_ = false;
  if (commit_start_) last_commit_s_ = seconds_since(*std::exchange(commit_start_, std::nullopt));
}

std::optional<WorkLeft> ShardPace::work_left() const {
  const std::lock_guard lock(mutex_);
  if (!is_open_) return std::nullopt;
  WorkLeft left;
  left.samples = samples_ - samples_taken_;
  left.seconds_per_sample =
      seconds_since(start_) / static_cast<double>(std::max<std::int64_t>(taken_, 1));
  left.commit_seconds = commit_seconds();
  left.abort_seconds = threads_ * left.seconds_per_sample;
  return left;
}

double ShardPace::seconds_since(std::chrono::steady_clock::time_point start) const {
  return std::chrono::duration<double>(clock_() - start).count();
}

double ShardPace::commit_seconds() const {
  if (last_commit_s_) return *last_commit_s_;
  const double bytes_per_sample =
      static_cast<double>(bytes_) / static_cast<double>(std::max(samples_taken_, 1));
  return bytes_per_sample * samples_ / kAssumedBytesPerSecond;
}

StopMonitor::StopMonitor(SinceRequest since_request, double grace_s, Left left)
    : since_request_(std::move(since_request)), grace_s_(grace_s), left_(std::move(left)) {
  if (!since_request_) return;
  order();
  thread_ = std::jthread([this](const std::stop_token& end) {
    std::mutex mutex;
    std::condition_variable_any wake;
    std::unique_lock lock(mutex);
    while (order_ != StopOrder::kAbort && !end.stop_requested()) {
      wake.wait_for(lock, end, kInterval, [] { return false; });
      order();
    }
  });
}

// Here, since users of oneTBB are compiled without the thread sanitizer, which must see this.
StopMonitor::~StopMonitor() = default;

StopOrder StopMonitor::order() const {
  if (!since_request_) return StopOrder::kGoOn;
  const StopOrder now = stop_order(since_request_(), grace_s_, left_());
  StopOrder strictest = order_.load();
  while (strictest < now && !order_.compare_exchange_weak(strictest, now)) {
  }
  return std::max(strictest, now);
}

namespace {

constexpr std::array kSignals{SIGINT, SIGTERM, SIGUSR1};
constexpr std::int64_t kNever = -1;

std::string told_at_interrupt;  // changes only while no handler is there that reads it
std::atomic<std::int64_t> requested_at_ns{kNever};
static_assert(std::atomic<std::int64_t>::is_always_lock_free, "a signal handler sets it");

/// One of the few functions that a signal handler may call.
std::int64_t monotonic_ns() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{1'000'000'000} * now.tv_sec + now.tv_nsec;
}

void request_stop(int signal) {
  std::int64_t never = kNever;
  requested_at_ns.compare_exchange_strong(never, monotonic_ns());
  if (signal != SIGINT) return;
  const int error = errno;
  [[maybe_unused]] const ssize_t written =
      ::write(STDERR_FILENO, told_at_interrupt.data(), told_at_interrupt.size());
  errno = error;
}

}  // namespace

StopSignal::StopSignal(std::string told) {
  requested_at_ns = kNever;
  told_at_interrupt = std::move(told);
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    struct sigaction action {};
    action.sa_handler = request_stop;
    sigemptyset(&action.sa_mask);
    action.sa_flags = SA_RESTART;
    if (kSignals[i] == SIGINT) action.sa_flags |= static_cast<int>(SA_RESETHAND);
    sigaction(kSignals[i], &action, &before_[i]);
  }
}

StopSignal::~StopSignal() {
  for (std::size_t i = 0; i < kSignals.size(); ++i) sigaction(kSignals[i], &before_[i], nullptr);
}

bool StopSignal::requested() const { return requested_at_ns != kNever; }

std::optional<double> StopSignal::seconds_since_request() const {
  const std::int64_t at_ns = requested_at_ns;
  if (at_ns == kNever) return std::nullopt;
  return 1e-9 * static_cast<double>(monotonic_ns() - at_ns);
}

}  // namespace eventgan
