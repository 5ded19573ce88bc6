#include "stages/events/drawn_events.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>

#include "stages/base/processor_clones.h"

namespace eventgan {
namespace {

/// Of one polarity [bin, pixel]; the pixels' random numbers begin at `first_random`.
EVENTGAN_CLONES
void draw_polarity(float* volume, std::size_t bins, std::size_t plane, const CounterRandom& random,
                   std::size_t first_random) {
  constexpr std::size_t kTogether = 256;  // bin after bin, so that memory is read in its order
  std::array<float, kTogether> sums;  // u + Λ, without the whole part: that keeps its precision
  for (std::size_t first = 0; first < plane; first += kTogether) {
    const std::size_t count = std::min(kTogether, plane - first);
    for (std::size_t i = 0; i < count; ++i) {
      // 24 bits, of which float32 rounds none up to 1.
      sums[i] = static_cast<float>(random.bits(first_random + first + i) >> 40) * 0x1p-24f;
    }
    for (std::size_t bin = 0; bin < bins; ++bin) {
      float* const values = volume + bin * plane + first;
      for (std::size_t i = 0; i < count; ++i) {
        const float sum = sums[i] + values[i];
        values[i] = std::floor(sum);
        sums[i] = sum - values[i];
      }
    }
  }
}

}  // namespace

void draw_events(std::span<float> volume, const VolumeShape& shape, const CounterRandom& random) {
  if (volume.size() != shape.value_count()) {
    throw std::invalid_argument("expected " + std::to_string(shape.value_count()) +
                                " values of a volume, got " + std::to_string(volume.size()));
  }
  const std::size_t plane = shape.size.pixel_count();
  const auto bins = static_cast<std::size_t>(shape.bins);
  draw_polarity(volume.data(), bins, plane, random, 0);
  draw_polarity(volume.data() + bins * plane, bins, plane, random, plane);
}

}  // namespace eventgan
