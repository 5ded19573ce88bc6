#pragma once

#include <compare>
#include <cstdint>

#include "manifests/training_manifest.h"

namespace eventgan {

/// The next step of a training: phase and step within it. A phase that is complete has `step` equal
/// to its number of steps.
struct TrainingPosition {
  TrainingPhase phase = TrainingPhase::kFlow;
  std::int64_t step = 0;
  auto operator<=>(const TrainingPosition&) const = default;
};

/// Number of steps of a phase.
inline std::int64_t steps_of(const PhaseSteps& steps, TrainingPhase phase) {
  return phase == TrainingPhase::kFlow             ? steps.flow
         : phase == TrainingPhase::kReconstruction ? steps.reconstruction
                                                   : steps.generator;
}

}  // namespace eventgan
