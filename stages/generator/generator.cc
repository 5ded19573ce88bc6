#include "stages/generator/generator.h"

#include <stdexcept>
#include <string>

namespace eventgan {

void check_generator_spans(std::span<const float> frames, ImageSize size,
                           std::span<const float> volume, int bins) {
  const std::size_t plane = size.pixel_count();
  if (size.height >= 1 && size.width >= 1 && frames.size() == 2 * plane &&
      volume.size() == 2 * bins * plane) {
    return;
  }
  throw std::invalid_argument(
      "expected frames [2, H, W] and a volume [" + std::to_string(2 * bins) + ", H, W] of " +
      std::to_string(size.width) + "x" + std::to_string(size.height) + ", got " +
      std::to_string(frames.size()) + " and " + std::to_string(volume.size()) + " values");
}

}  // namespace eventgan
