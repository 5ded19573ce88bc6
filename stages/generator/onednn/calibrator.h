#pragma once

#include <memory>
#include <optional>
#include <string>

#include "stages/generator/calibration.h"
#include "stages/generator/generator.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The statistics that the sums give. With r = max(x, 0), l = min(x, 0) and covariances over the
/// summed pixels, the guess l ≈ offset + mixing r is the ridge regression
///   mixing = cov(l, r) (cov(r, r) + D)^-1,   offset = E[l] - mixing E[r],
///   D = diag(0.1 var(r_c) + 0.001 mean variance):
/// the first part keeps it calm with few pairs, the second for channels that hardly ever move. A
/// tensor that does not vary has no mixing.
/// Throws std::invalid_argument if no pair was summed, std::runtime_error if the regression fails
/// or a number leaves float32. Deterministic.
Calibration fit_calibration(const CalibrationSums& sums, std::string origin);

/// Finds a calibration: runs the network in float32 on real pairs and sums up what its tensors
/// hold. The same pairs in the same order give the same calibration, on one kind of processor.
/// Memory does not grow with the number of pairs. Not thread safe.
class Calibrator {
 public:
  /// Throws as make_onednn_generator in float32.
  explicit Calibrator(const Weights& weights);
  ~Calibrator();

  /// Adds a pair, as Generator::generate takes it. Throws std::invalid_argument if the frames do
  /// not have this size, std::runtime_error if a value is not finite or oneDNN fails; then nothing
  /// was added.
  void add(const GeneratorInput& pair);

  int pairs() const { return sums_.pairs; }

  /// The calibration of the pairs so far. Throws as fit_calibration.
  Calibration calibration(std::string origin) const;

 private:
  struct Network;
  std::unique_ptr<Network> network_;
  CalibrationSums sums_;
  int base_channels_;
  std::optional<ThresholdRange> thresholds_;
};

}  // namespace eventgan
