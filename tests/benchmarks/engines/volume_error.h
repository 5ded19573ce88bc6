#pragma once

#include <span>

namespace eventgan {

/// How far a volume is from the one it should be.
struct VolumeError {
  double relative_l2 = 0;       ///< sqrt(Σ (v - expected)²) / sqrt(Σ expected²)
  double relative_largest = 0;  ///< max |v - expected| / max |expected|
};

/// Both volumes have the same size. Throws std::invalid_argument if `expected` is zero everywhere.
VolumeError volume_error(std::span<const float> volume, std::span<const float> expected);

}  // namespace eventgan
