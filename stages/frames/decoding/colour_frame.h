#pragma once

#include <cstdint>
#include <vector>

#include "manifests/image_size.h"

namespace eventgan {

/// A decoded colour picture: [y, x, channel] uint8, C order, channels blue, green, red, 0..255.
struct ColourFrame {
  ImageSize size;
  std::vector<std::uint8_t> bgr;
};

/// The same, owned by somebody else.
struct ColourView {
  ImageSize size;
  const std::uint8_t* bgr = nullptr;
};

}  // namespace eventgan
