#pragma once

#include <functional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "stages/generator/weights.h"

namespace eventgan::testing {

/// The generator's network (weights.h) written as plain loops in double precision: slow, and with
/// nothing in common with the engines it judges. planes [inputs, H, W], as network_planes() gives
/// them, → volume [2 bins, H, W].
/// `change` sees, and may change, the tensors [channel, y, x] of quantized_tensors(), and
/// decoders.3, behind their activations.
using TensorChange = std::function<void(const std::string& name, std::vector<double>& values)>;
std::vector<float> plain_network(const Weights& weights, const std::vector<float>& planes,
                                 ImageSize size, const TensorChange& change = {});

/// The 8-bit network as QuantizableNetwork describes it, as plain loops in double precision,
/// without phases: what an int8 engine computes but for float32 rounding and its own kernels'
/// steps. weights.calibration must be there. planes [inputs, H, W] → volume [2 bins, H, W].
std::vector<float> plain_int8_network(const Weights& weights, const std::vector<float>& planes,
                                      ImageSize size, int largest_weight = 127);

}  // namespace eventgan::testing
