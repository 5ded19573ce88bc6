#pragma once

#include <vector>

#include "manifests/image_size.h"
#include "stages/generator/weights.h"

namespace eventgan::testing {

/// The 8-bit network as QuantizableNetwork describes it, as plain loops in double precision,
/// without phases: what an int8 engine computes but for float32 rounding and its own kernels'
/// steps. weights.calibration must be there. frames [2, H, W] → volume [2 bins, H, W].
std::vector<float> plain_int8_network(const Weights& weights, const std::vector<float>& frames,
                                      ImageSize size, int largest_weight = 127);

}  // namespace eventgan::testing
