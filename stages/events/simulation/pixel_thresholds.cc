#include "stages/events/simulation/pixel_thresholds.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace eventgan {
namespace {

double gaussian(CounterRandom random, std::size_t pixel) {
  // 1 - uniform lies in (0, 1]: its logarithm is finite.
  const double radius = std::sqrt(-2.0 * std::log(1.0 - random.uniform(2 * pixel)));
  return radius * std::cos(2.0 * std::numbers::pi * random.uniform(2 * pixel + 1));
}

}  // namespace

std::vector<float> draw_thresholds(double mean, double spread, std::size_t pixel_count,
                                   CounterRandom random) {
  std::vector<float> thresholds(pixel_count);
  for (std::size_t pixel = 0; pixel < pixel_count; ++pixel) {
    const double drawn = spread > 0 ? mean + spread * gaussian(random, pixel) : mean;
    thresholds[pixel] = std::max(static_cast<float>(drawn), kSmallestThreshold);
  }
  return thresholds;
}

}  // namespace eventgan
