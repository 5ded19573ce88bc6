#include "pipeline/stopping/shard_pace.h"

#include <algorithm>
#include <utility>

namespace eventgan {
namespace {

/// Flushing and hashing before the first commit was measured: a slow disk.
constexpr double kAssumedBytesPerSecond = 100e6;

}  // namespace

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

std::optional<OpenShard> ShardPace::open_shard() const {
  const std::lock_guard lock(mutex_);
  if (!is_open_) return std::nullopt;
  OpenShard open;
  open.samples_left = samples_ - samples_taken_;
  open.seconds_per_sample =
      seconds_since(start_) / static_cast<double>(std::max<std::int64_t>(taken_, 1));
  open.commit_seconds = commit_seconds();
  open.abort_seconds = threads_ * open.seconds_per_sample;
  return open;
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

}  // namespace eventgan
