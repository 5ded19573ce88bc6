#pragma once

#include <ATen/core/Tensor.h>
#include <c10/core/Device.h>

#include <span>

#include "stages/training/training_sample.h"

namespace eventgan {

/// Samples as tensors: float32, channels last in memory (the faster layout on CPU), on one device.
struct TrainingBatch {
  at::Tensor frames;           ///< [B, 2, H, W], previous then next, in [-1, 1], as recorded
  at::Tensor network_frames;   ///< [B, 2, H, W], with gain and gamma
  at::Tensor volume;           ///< [B, 2 bins, H, W], real, as TrainingSample has it
  at::Tensor expected;         ///< [B, 2 bins, H, W], the teacher's rates; without one `volume`
  at::Tensor generator_input;  ///< [B, 2 or 3, H, W]: the network frames, or sensor_input of them

  at::Tensor previous() const { return frames.narrow(1, 0, 1); }       ///< [B, 1, H, W]
  at::Tensor next() const { return frames.narrow(1, 1, 1); }           ///< [B, 1, H, W]
  at::Tensor has_events() const { return volume.sum(1, true).gt(0); }  ///< [B, 1, H, W] bool
};

/// Throws std::invalid_argument if there is no sample, or one has not the shape and numbers of the
/// first, or not `bins` bins.
TrainingBatch make_training_batch(std::span<const TrainingSample> samples, int bins,
                                  c10::Device device);

}  // namespace eventgan
