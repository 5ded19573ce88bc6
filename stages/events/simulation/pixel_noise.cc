#include "stages/events/simulation/pixel_noise.h"

#include <cmath>
#include <limits>

namespace eventgan {

PixelNoise::PixelNoise(const SensorSpec& spec, std::size_t pixel_count, double start_s,
                       CounterRandom random)
    : shot_rate_hz_(spec.shot_noise_rate_hz),
      hot_rate_hz_(spec.hot_pixel_rate_hz),
      wait_random_(random.keyed("wait")),
      kind_random_(random.keyed("kind")),
      next_s_(pixel_count, start_s),
      draws_(pixel_count, 0),
      hot_(pixel_count, 0) {
  const CounterRandom hot_random = random.keyed("hot");
  for (std::size_t pixel = 0; pixel < pixel_count; ++pixel) {
    if (hot_random.uniform(2 * pixel) < spec.hot_pixel_fraction) {
      hot_[pixel] = hot_random.below(2 * pixel + 1, 2) == 0 ? -1 : 1;
    }
    draw_wait(pixel);
  }
}

bool PixelNoise::take(std::size_t pixel) {
  // One draw says which of the superposed processes this arrival belongs to.
  const std::uint64_t arrival = (draws_[pixel] - 1) * next_s_.size() + pixel;
  const double kind_hz = kind_random_.uniform(arrival) * rate_hz(pixel);
  draw_wait(pixel);
  if (kind_hz < shot_rate_hz_) return kind_hz < shot_rate_hz_ / 2;
  return hot_[pixel] > 0;
}

double PixelNoise::rate_hz(std::size_t pixel) const {
  return hot_[pixel] == 0 ? shot_rate_hz_ : shot_rate_hz_ + hot_rate_hz_;
}

void PixelNoise::draw_wait(std::size_t pixel) {
  const double rate = rate_hz(pixel);
  if (!(rate > 0)) {
    next_s_[pixel] = std::numeric_limits<double>::infinity();
    return;
  }
  const std::uint64_t arrival = draws_[pixel]++ * next_s_.size() + pixel;
  next_s_[pixel] -= std::log1p(-wait_random_.uniform(arrival)) / rate;
}

}  // namespace eventgan
