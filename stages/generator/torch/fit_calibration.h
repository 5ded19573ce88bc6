#pragma once

#include <string>

#include "stages/generator/calibration/calibration.h"
#include "stages/generator/calibration/calibration_sums.h"

namespace eventgan {

/// The statistics that the sums give. With r = max(x, 0), l = min(x, 0) and covariances over the
/// summed pixels, the guess l ≈ offset + mixing r is the ridge regression
///   mixing = cov(l, r) (cov(r, r) + D)^-1,   offset = E[l] - mixing E[r],
///   D = diag(0.1 var(r_c) + 0.001 mean variance):
/// the first part keeps it calm with few pairs, the second for channels that hardly ever move. A
/// tensor that does not vary has no mixing.
/// Throws std::invalid_argument if no pair was summed, std::runtime_error if LibTorch fails or a
/// number leaves float32. Deterministic.
Calibration fit_calibration(const CalibrationSums& sums, std::string origin);

}  // namespace eventgan
