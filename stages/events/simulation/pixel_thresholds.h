#pragma once

#include <cstddef>
#include <vector>

#include "manifests/counter_random.h"

namespace eventgan {

/// No pixel's contrast threshold is below this, however wide the spread.
inline constexpr float kSmallestThreshold = 0.01f;

/// Contrast thresholds of one polarity, one a pixel in C order: Gaussian (Box and Muller 1958)
/// about `mean` with standard deviation `spread`, raised to kSmallestThreshold where lower. Thread
/// safe.
std::vector<float> draw_thresholds(double mean, double spread, std::size_t pixel_count,
                                   CounterRandom random);

}  // namespace eventgan
