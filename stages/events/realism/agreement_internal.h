#pragma once

#include <span>

#include "manifests/volume.h"

namespace eventgan {

/// A voxel, or a sum of voxels, above this counts as an event (V2CE, Zhang et al. 2024).
inline constexpr float kEventThreshold = 0.01f;

/// F1 = 2 TP / (2 TP + FP + FN) of "is an event" (value > kEventThreshold), position by position;
/// 1 if neither has an event. Spans of one size.
double binary_match_f1(std::span<const float> values, std::span<const float> real);

/// Mean squared difference of two arrays [planes, y, x] after mean pooling over blocks of
/// side x side pixels, every block counting alike; a block cut by the border is the mean of what it
/// has.
double pool_mse(std::span<const float> values, std::span<const float> real, ImageSize size,
                int side);

/// Pearson correlation; NaN if there are no values or one side is constant.
double pearson(std::span<const double> a, std::span<const double> b);

}  // namespace eventgan
