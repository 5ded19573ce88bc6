#pragma once

#include <cstdint>
#include <vector>

#include "manifests/image_size.h"

namespace eventgan {

/// A grey picture: [y, x] uint8, C order, 0..255.
struct GreyImage {
  ImageSize size;
  std::vector<std::uint8_t> pixels;
  bool operator==(const GreyImage&) const = default;
};

}  // namespace eventgan
