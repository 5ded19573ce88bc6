#pragma once

#include <chrono>
#include <cstdint>
#include <iosfwd>
#include <map>
#include <string>

#include "pipeline/progress/progress.h"
#include "pipeline/training/training_position.h"

namespace eventgan {

/// Progress of a training (see ProgressDisplay): phase, steps, rate, time left and the phase's
/// losses, each as last computed.
class TrainingProgress {
 public:
  using Clock = ProgressDisplay::Clock;

  TrainingProgress(std::ostream& stream, ProgressStyle style, bool is_terminal,
                   Clock clock = std::chrono::steady_clock::now);

  /// `done` of the phase's `total` steps are done, the last with these losses.
  void advance(TrainingPhase phase, std::int64_t done, std::int64_t total,
               const std::map<std::string, double>& losses);

 private:
  void show();

  ProgressDisplay display_;
  std::chrono::steady_clock::time_point start_;  // of this run's part of the phase
  TrainingPhase phase_ = TrainingPhase::kFlow;
  std::int64_t first_ = -1;  // steps done when it began; -1: not begun
  std::int64_t done_ = 0;
  std::int64_t total_ = 0;
  std::map<std::string, double> losses_;
};

}  // namespace eventgan
