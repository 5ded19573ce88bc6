#include "stages/events/noise.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "manifests/values/frames.h"
#include "manifests/values/poisson_random.h"

namespace eventgan {
namespace {

/// More events a voxel than this are faster drawn as one number a voxel.
constexpr double kManyEvents = 8;

double drawn(const std::array<double, 2>& range, const CounterRandom& random,
             std::uint64_t counter) {
  return range[0] + (range[1] - range[0]) * random.uniform(counter);
}

/// Share of the interval that has this as the nearest bin.
double share_of_bin(int bin, int bins) {
  if (bins == 1) return 1;
  const double whole = 1.0 / (bins - 1);
  return bin == 0 || bin == bins - 1 ? whole / 2 : whole;
}

/// Events of one channel, `mean` a pixel. Returns their number.
double scatter(double mean, const CounterRandom& random, std::span<float> plane) {
  double total = 0;
  if (mean > kManyEvents) {
    for (std::size_t pixel = 0; pixel < plane.size(); ++pixel) {
      const double count = poisson(mean, random, pixel, plane.size());
      plane[pixel] += static_cast<float>(count);
      total += count;
    }
    return total;
  }
  total = poisson(mean * static_cast<double>(plane.size()), random.keyed("count"), 0);
  const auto events = static_cast<std::uint64_t>(total);
  for (std::uint64_t event = 0; event < events; ++event) {
    plane[random.below(event, plane.size())] += 1;
  }
  return total;
}

double add_hot_pixels(double share, double duration_s, const VolumeShape& shape,
                      const NoiseRandom& random, std::span<float> volume) {
  const CounterRandom camera = random.camera.keyed(to_string(shape.size));
  const CounterRandom rates = camera.keyed("rate");
  const CounterRandom polarities = camera.keyed("polarity");
  const CounterRandom counts = random.pair.keyed("hot pixels");
  const std::size_t pixels = shape.size.pixel_count();
  const auto bins = static_cast<std::size_t>(shape.bins);
  double total = 0;
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    if (camera.uniform(pixel) >= share) continue;
    const double rate_hz =
        kLeastHotPixel_hz * std::pow(kMostHotPixel_hz / kLeastHotPixel_hz, rates.uniform(pixel));
    const std::size_t first_channel = polarities.bits(pixel) & 1 ? bins : 0;
    for (std::size_t bin = 0; bin < bins; ++bin) {
      const double mean = rate_hz * duration_s * share_of_bin(static_cast<int>(bin), shape.bins);
      const std::size_t voxel = (first_channel + bin) * pixels + pixel;
      const double count = poisson(mean, counts, voxel, volume.size());
      volume[voxel] += static_cast<float>(count);
      total += count;
    }
  }
  return total;
}

}  // namespace

double add_noise(const NoiseSpec& spec, double duration_s, const VolumeShape& shape,
                 const NoiseRandom& random, std::span<float> volume) {
  if (volume.size() != shape.value_count()) {
    throw std::invalid_argument("expected a volume of " + std::to_string(shape.value_count()) +
                                " values, got " + std::to_string(volume.size()));
  }
  const double shot_hz = drawn(spec.shot_hz, random.pair, 0);
  const double leak_hz = drawn(spec.leak_hz, random.pair, 1);
  const double hot_share = drawn(spec.hot_pixels, random.pair, 2);
  const std::size_t pixels = shape.size.pixel_count();
  double total = 0;
  for (int channel = 0; channel < shape.channels(); ++channel) {
    const double rate_hz = shot_hz / 2 + (channel < shape.bins ? leak_hz : 0);
    const double mean = rate_hz * duration_s * share_of_bin(channel % shape.bins, shape.bins);
    total += scatter(mean, random.pair.keyed(std::to_string(channel)),
                     volume.subspan(static_cast<std::size_t>(channel) * pixels, pixels));
  }
  if (hot_share > 0) total += add_hot_pixels(hot_share, duration_s, shape, random, volume);
  return total;
}

}  // namespace eventgan
