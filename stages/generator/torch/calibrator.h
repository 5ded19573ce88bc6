#pragma once

#include <memory>
#include <span>
#include <string>

#include "manifests/image_size.h"
#include "stages/generator/calibration/calibration.h"
#include "stages/generator/calibration/calibration_sums.h"
#include "stages/generator/weights.h"

namespace eventgan {

class NetworkForward;

/// Finds a calibration: runs the float32 reference on real pairs and sums up what its tensors hold.
/// The same pairs in the same order give the same calibration, on one kind of processor. Memory
/// does not grow with the number of pairs. Not thread safe.
class Calibrator {
 public:
  /// Throws as check_weights; std::runtime_error if LibTorch fails.
  explicit Calibrator(const Weights& weights);
  ~Calibrator();

  /// Adds a pair; frames as Generator::generate takes them. Throws std::invalid_argument if the
  /// span does not have this size, std::runtime_error if a tensor is not finite or LibTorch fails;
  /// then nothing was added.
  void add(std::span<const float> frames, ImageSize size);

  int pairs() const { return sums_.pairs; }

  /// The calibration of the pairs so far. Throws as fit_calibration.
  Calibration calibration(std::string origin) const;

 private:
  std::unique_ptr<const NetworkForward> forward_;
  CalibrationSums sums_;
  int base_channels_;
};

}  // namespace eventgan
