#pragma once

#include <cstddef>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/onednn/eight_lanes.h"
#include "stages/generator/onednn/layer_numbers.h"

namespace eventgan {

// The network's first and last layers, between images in planes and images in channels, in float32
// where winograd_fits.

/// The head: 3x3 from planes to channels, LeakyReLU included. Thread safe.
class HeadConvolution {
 public:
  explicit HeadConvolution(const LayerNumbers& head);

  std::size_t buffer_bytes(ImageSize size) const;

  /// inputs: [input, y, x]; output: [y, x, channel].
  void run(const float* inputs, ImageSize size, float* output, std::byte* buffer) const;

 private:
  int in_, out_;
  std::vector<EightWeights> weights_;  ///< [out / 8, row, in, column, out % 8]
  std::vector<EightWeights> bias_;
};

/// The last layer: 1x1 from channels to an even number of planes, ReLU included. Thread safe.
class PlanePrediction {
 public:
  explicit PlanePrediction(const LayerNumbers& pred);

  /// As many pixels must follow those that are given, whatever they are.
  static constexpr int kPixels = 32;
  std::size_t buffer_bytes() const;

  /// Pixels [x, channel] from first_x to end_x - 1 of row y into the planes of `volume`, [channel,
  /// y, x]; NaN stays NaN. Whether all values are finite before the ReLU.
  bool run(const float* pixels, ImageSize size, int y, int first_x, int end_x, float* volume,
           std::byte* buffer) const;

 private:
  int in_, out_;
  std::vector<float> weights_;  ///< [out, in]
  std::vector<float> bias_;
};

}  // namespace eventgan
