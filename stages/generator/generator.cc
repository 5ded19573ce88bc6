#include "stages/generator/generator.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace eventgan {

GenerationNotes Generator::generate_tiles(const GeneratorInput& pair, const TileMask& wanted,
                                          std::span<float> volume) const {
  if (std::ranges::find(wanted.wanted, 1) == wanted.wanted.end()) {
    check_generator_spans({pair.frames, wanted.size}, volume, bins());
    std::ranges::fill(volume, 0.0f);
    return {};
  }
  const GenerationNotes notes = generate(pair, volume);
  clear_unwanted(wanted, volume);
  return notes;
}

bool all_finite(std::span<const float> values) {
  return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
}

void clear_unwanted(const TileMask& wanted, std::span<float> volume) {
  const std::size_t plane = wanted.size.pixel_count();
  for (std::size_t first = 0; first < volume.size(); first += plane) {
    wanted.visit_tiles(false, [&](const TileMask::Pixels& tile) {
      for (int y = tile.top; y < tile.bottom; ++y) {
        float* row = volume.data() + first + static_cast<std::size_t>(y) * wanted.size.width;
        std::fill(row + tile.left, row + tile.right, 0.0f);
      }
    });
  }
}

void check_generator_spans(const GeneratorInput& pair, std::span<const float> volume, int bins) {
  const ImageSize size = pair.size;
  const std::size_t plane = size.pixel_count();
  if (size.height >= 1 && size.width >= 1 && pair.frames.size() == 2 * plane &&
      volume.size() == 2 * bins * plane) {
    return;
  }
  throw std::invalid_argument("expected frames [2, H, W] and a volume [" +
                              std::to_string(2 * bins) + ", H, W] of " + to_string(size) +
                              ", got " + std::to_string(pair.frames.size()) + " and " +
                              std::to_string(volume.size()) + " values");
}

}  // namespace eventgan
