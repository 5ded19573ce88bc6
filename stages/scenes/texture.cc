#include "stages/scenes/texture.h"

#include <cmath>
#include <cstdint>

namespace eventgan {
namespace {

/// 3 t^2 - 2 t^3: from 0 to 1 with flat ends, which hides the grid.
float eased(double t) { return static_cast<float>(t * t * (3 - 2 * t)); }

}  // namespace

float Texture::cell(int x, int y) const {
  const auto counter =
      (std::uint64_t{static_cast<std::uint32_t>(x)} << 32) | static_cast<std::uint32_t>(y);
  return static_cast<float>(random_.bits(counter) >> 40) * 0x1.0p-24f;
}

float Texture::noise(double x, double y) const {
  const double left = std::floor(x);
  const double top = std::floor(y);
  const float right_share = eased(x - left);
  const float lower_share = eased(y - top);
  const int i = static_cast<int>(left);
  const int j = static_cast<int>(top);
  const float upper = cell(i, j) * (1 - right_share) + cell(i + 1, j) * right_share;
  const float lower = cell(i, j + 1) * (1 - right_share) + cell(i + 1, j + 1) * right_share;
  return upper * (1 - lower_share) + lower * lower_share;
}

}  // namespace eventgan
