#include "stages/events/simulation/linear_intensity.h"

#include <algorithm>
#include <stdexcept>
#include <string>

namespace eventgan {

std::vector<float> linear_intensity(const GreyImage& picture) {
  const ImageSize& size = picture.size;
  if (size.height < 1 || size.width < 1 || picture.pixels.size() != size.pixel_count()) {
    throw std::invalid_argument("expected a picture, got " + std::to_string(size.height) + " x " +
                                std::to_string(size.width) + " with " +
                                std::to_string(picture.pixels.size()) + " pixels");
  }
  std::vector<float> intensity(picture.pixels.size());
  std::ranges::transform(picture.pixels, intensity.begin(),
                         [](std::uint8_t value) { return static_cast<float>(value) / 255.0f; });
  return intensity;
}

}  // namespace eventgan
