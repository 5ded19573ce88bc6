#pragma once

#include <chrono>
#include <cstdint>
#include <iosfwd>
#include <map>
#include <string>

#include "manifests/values/training.h"
#include "pipeline/runtime/progress.h"

namespace eventgan {

/// Progress of a training (see ProgressDisplay): phase, steps, rate, time left and the phase's
/// losses, each as last computed.
class TrainingProgress {
 public:
  using Clock = ProgressDisplay::Clock;

  TrainingProgress(std::ostream& stream, ProgressStyle style, ProgressDisplay::Columns columns,
                   Clock clock = std::chrono::steady_clock::now);

  /// See ProgressDisplay::keep_up(); from the first step on.
  void keep_up() { keeps_up_ = true; }

  /// `done` of the phase's `total` steps are done, the last with these losses.
  void advance(TrainingPhase phase, std::int64_t done, std::int64_t total,
               const std::map<std::string, double>& losses);

 private:
  ProgressText describe(std::chrono::steady_clock::time_point now) const;

  std::chrono::steady_clock::time_point start_;  // of this run's part of the phase
  TrainingPhase phase_ = TrainingPhase::kFlow;
  std::int64_t first_ = -1;  // steps done when it began; -1: not begun
  std::int64_t done_ = 0;
  std::int64_t total_ = 0;
  std::map<std::string, double> losses_;
  bool keeps_up_ = false;
  ProgressDisplay display_;
};

/// How a run of a training ended.
struct TrainingReport {
  std::string folder;
  bool complete = false;                 ///< all steps of all phases are done
  TrainingPosition position;             ///< the next step
  std::int64_t steps_made = 0;           ///< by this run
  double run_seconds = 0;                ///< of this run
  double total_seconds = 0;              ///< of all runs together, as far as it counts
  std::map<std::string, double> losses;  ///< means over the last steps of the last phase
  std::string weights;                   ///< the final weights' path; empty if there are none
  std::string weights_sha256;
};

std::string to_text(const TrainingReport& report);
std::string to_json(const TrainingReport& report);

}  // namespace eventgan
