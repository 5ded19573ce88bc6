#pragma once

#include <string_view>

namespace eventgan {

/// In which numbers the network's convolutions are computed. The volume is float32 always.
enum class Precision {
  kFloat32,
  kBfloat16,  ///< activations and weights bfloat16, sums float32
  kInt8       ///< activations uint8, weights int8, sums int32; needs a calibration
};

/// What computes the network.
enum class Engine { kTorch, kOnednn };

/// The manifest's words for these values.
std::string_view to_string(Precision precision);
std::string_view to_string(Engine engine);

}  // namespace eventgan
