#include "stages/synthetic/scenes/image.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace eventgan {
namespace {

std::uint8_t rounded(float value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0f, 255.0f)));
}

/// 3 t^2 - 2 t^3: from 0 to 1 with flat ends, which hides the grid.
float eased(double t) { return static_cast<float>(t * t * (3 - 2 * t)); }

}  // namespace

Image black_image(ImageSize size) {
  return {size, std::vector<std::uint8_t>(3 * size.pixel_count(), 0)};
}

void set_pixel(Image& image, int x, int y, const Colour& colour) {
  std::uint8_t* pixel = image.bgr.data() + 3 * (static_cast<std::size_t>(y) * image.size.width + x);
  pixel[0] = rounded(colour.blue);
  pixel[1] = rounded(colour.green);
  pixel[2] = rounded(colour.red);
}

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
