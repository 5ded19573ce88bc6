#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <iosfwd>
#include <map>
#include <string>

#include "pipeline/progress/progress.h"
#include "pipeline/training/training_position.h"

namespace eventgan {

/// Shows how a training goes on a stream: a bar redrawn in place, a plain line every 10 s, or a
/// JSON line a second; phase, steps, rate, time left and the phase's losses, each as last computed.
/// Not thread safe.
class TrainingProgress {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  /// kAuto asks whether the stream's terminal is there: `is_terminal`. `clock` is for tests.
  TrainingProgress(std::ostream& stream, ProgressStyle style, bool is_terminal,
                   Clock clock = std::chrono::steady_clock::now);

  /// Ends the bar's line.
  ~TrainingProgress();
  TrainingProgress(const TrainingProgress&) = delete;
  TrainingProgress& operator=(const TrainingProgress&) = delete;

  /// `done` of the phase's `total` steps are done, the last with these losses.
  void advance(TrainingPhase phase, std::int64_t done, std::int64_t total,
               const std::map<std::string, double>& losses);

 private:
  void show();
  std::string line() const;
  std::string json_line() const;
  double steps_per_second() const;

  std::ostream& stream_;
  ProgressStyle style_;
  Clock clock_;
  std::chrono::steady_clock::time_point start_;  // of this run's part of the phase
  std::chrono::steady_clock::time_point shown_;
  TrainingPhase phase_ = TrainingPhase::kFlow;
  std::int64_t first_ = -1;  // steps done when it began; -1: not begun
  std::int64_t done_ = 0;
  std::int64_t total_ = 0;
  std::map<std::string, double> losses_;
  std::size_t widest_ = 0;
};

}  // namespace eventgan
