#pragma once

#include <vector>

#include "manifests/plan.h"

namespace eventgan {

/// A sample of a plan that takes part in a calibration.
struct CalibrationSample {
  const PlannedShard* shard = nullptr;
  int slot = 0;
  bool held_out = false;  ///< for measuring the error, not for the calibration

  const PlannedSample& planned() const { return shard->samples[static_cast<std::size_t>(slot)]; }
};

/// Up to `pairs` samples to calibrate on and up to `held_out` others, spread evenly over the plan's
/// samples without known faults and in the plan's order, so that each source has its share: of T
/// samples the first of each T / (pairs + held_out), and of these every so many is held out. Of few
/// samples at most a fifth is held out. Pure; the result points into the plan.
std::vector<CalibrationSample> choose_calibration_samples(const Plan& plan, int pairs,
                                                          int held_out);

}  // namespace eventgan
