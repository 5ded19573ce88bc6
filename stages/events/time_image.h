#pragma once

#include <span>
#include <vector>

#include "manifests/volume.h"

namespace eventgan {

/// The average-timestamp picture of the paper, per polarity: at each pixel the mean of the bins'
/// times τ_b = 0.1 + 0.9 b/(B-1), weighted by the volume: T(x,y) = Σ_b τ_b V_b / (Σ_b V_b + 1e-5);
/// 0 without events. The published picture is (positive + negative)/2.
struct TimeImage {
  ImageSize size;
  std::vector<float> positive;  ///< [y, x] in [0, 1]
  std::vector<float> negative;  ///< [y, x] in [0, 1]
};

/// volume: [2 bins, H, W] float32, ≥ 0, C order. B = 1 has τ = 0.1. Thread safe.
TimeImage time_image(std::span<const float> volume, const VolumeShape& shape);

}  // namespace eventgan
