#pragma once

#include "stages/generator/calibration/calibration.h"

namespace eventgan::testing {

/// A calibration of random numbers: ranges over three powers of ten, means below them, small
/// offsets and mixings. The same seed gives the same numbers.
Calibration sample_calibration(int base_channels, std::uint64_t seed);

}  // namespace eventgan::testing
