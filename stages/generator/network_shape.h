#pragma once

#include "manifests/image_size.h"

namespace eventgan {

// What of the network's shape (DESIGN section 4) does not depend on the weights.

inline constexpr int kNetworkLevels = 4;  ///< encoders, and as many decoders
inline constexpr int kResidualBlocks = 2;
inline constexpr float kLeakySlope = 0.01f;  ///< LeakyReLU turns x < 0 into this times x

/// Size of what an encoder makes of a picture: both sides halved, rounded up.
constexpr ImageSize half_size(ImageSize size) {
  return {(size.height + 1) / 2, (size.width + 1) / 2};
}

}  // namespace eventgan
