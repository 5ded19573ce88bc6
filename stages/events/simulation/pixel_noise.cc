#include "stages/events/simulation/pixel_noise.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "manifests/values/gaussian_random.h"

namespace eventgan {

double own_rate(double mean, const CounterRandom& random, std::size_t pixel) {
  constexpr double kBias = kNoiseRateSpread * kNoiseRateSpread / 2;
  return mean * std::exp(kNoiseRateSpread * gaussian(random, pixel) - kBias);
}

PixelNoise::PixelNoise(const SensorSpec& spec, std::size_t pixel_count, double start_s,
                       CounterRandom random)
    : shot_rate_hz_(pixel_count, 0.0f),
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
    if (spec.shot_noise_rate_hz > 0) {
      shot_rate_hz_[pixel] =
          static_cast<float>(own_rate(spec.shot_noise_rate_hz, random.keyed("shot rate"), pixel));
    }
    draw_wait(pixel);
  }
}

bool PixelNoise::any(const SensorSpec& spec) {
  return spec.shot_noise_rate_hz > 0 || (spec.hot_pixel_fraction > 0 && spec.hot_pixel_rate_hz > 0);
}

std::optional<bool> PixelNoise::take(std::size_t pixel, double light) {
  // One draw says which of the superposed processes this arrival belongs to. Arrivals have the rate
  // of the dark: of those of shot noise the light takes a share, so that their times stay.
  const std::uint64_t arrival = (draws_[pixel] - 1) * next_s_.size() + pixel;
  const double kind_hz = kind_random_.uniform(arrival) * rate_hz(pixel);
  draw_wait(pixel);
  const double shot_hz = shot_rate_hz_[pixel];
  if (kind_hz >= shot_hz) return hot_[pixel] > 0;
  const double seen_hz = shot_hz * (1 - (1 - kShotNoiseAtWhite) * std::clamp(light, 0.0, 1.0));
  if (kind_hz >= seen_hz) return std::nullopt;
  return kind_hz < seen_hz / 2;
}

double PixelNoise::rate_hz(std::size_t pixel) const {
  return hot_[pixel] == 0 ? double{shot_rate_hz_[pixel]} : shot_rate_hz_[pixel] + hot_rate_hz_;
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
