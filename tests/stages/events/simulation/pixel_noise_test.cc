#include "stages/events/simulation/pixel_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace eventgan {
namespace {

struct ArrivalCounts {
  std::vector<int> positive;
  std::vector<int> negative;
};

ArrivalCounts count_until(PixelNoise& noise, std::size_t pixels, double end_s) {
  ArrivalCounts counts{std::vector<int>(pixels), std::vector<int>(pixels)};
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    while (noise.next_s(pixel) <= end_s) {
      ++(noise.take(pixel) ? counts.positive : counts.negative)[pixel];
    }
  }
  return counts;
}

TEST(PixelNoise, ShotNoiseIsPoissonOfTheSetRateAndBalanced) {
  constexpr std::size_t kPixels = 4096;
  SensorSpec spec;
  spec.shot_noise_rate_hz = 2;
  PixelNoise noise(spec, kPixels, 100, CounterRandom(5));
  const ArrivalCounts counts = count_until(noise, kPixels, 105);
  const double expected = 2 * 5;  // a pixel
  double sum = 0;
  double squares = 0;
  double positive = 0;
  for (std::size_t pixel = 0; pixel < kPixels; ++pixel) {
    const double count = counts.positive[pixel] + counts.negative[pixel];
    sum += count;
    squares += (count - expected) * (count - expected);
    positive += counts.positive[pixel];
  }
  // Four standard deviations of a Poisson total, of its dispersion, and of a fair coin's count.
  EXPECT_NEAR(sum, expected * kPixels, 4 * std::sqrt(expected * kPixels));
  EXPECT_NEAR(squares / kPixels / expected, 1, 4 * std::sqrt(2.0 / kPixels));
  EXPECT_NEAR(positive, sum / 2, 4 * std::sqrt(sum) / 2);
}

TEST(PixelNoise, HotPixelsFireInOnePolarityAtTheirRate) {
  constexpr std::size_t kPixels = 2000;
  SensorSpec spec;
  spec.hot_pixel_fraction = 0.1;
  spec.hot_pixel_rate_hz = 100;
  PixelNoise noise(spec, kPixels, 0, CounterRandom(6));
  const ArrivalCounts counts = count_until(noise, kPixels, 1);
  int hot = 0;
  int hot_positive = 0;
  double sum = 0;
  for (std::size_t pixel = 0; pixel < kPixels; ++pixel) {
    EXPECT_TRUE(counts.positive[pixel] == 0 || counts.negative[pixel] == 0);
    hot += counts.positive[pixel] + counts.negative[pixel] > 0;
    hot_positive += counts.positive[pixel] > 0;
    sum += counts.positive[pixel] + counts.negative[pixel];
  }
  EXPECT_NEAR(hot, 200, 4 * std::sqrt(2000 * 0.1 * 0.9));
  EXPECT_NEAR(hot_positive, hot / 2.0, 4 * std::sqrt(hot) / 2);
  EXPECT_NEAR(sum, 100.0 * hot, 4 * std::sqrt(100.0 * hot));
}

TEST(PixelNoise, IsSilentAtRateZero) {
  SensorSpec spec;
  spec.hot_pixel_fraction = 1;
  const PixelNoise noise(spec, 3, 0, CounterRandom(1));
  for (std::size_t pixel = 0; pixel < 3; ++pixel) {
    EXPECT_EQ(noise.next_s(pixel), std::numeric_limits<double>::infinity());
  }
}

TEST(PixelNoise, ArrivalsRise) {
  SensorSpec spec;
  spec.shot_noise_rate_hz = 1e6;
  PixelNoise noise(spec, 1, 10, CounterRandom(1));
  double last_s = 10;
  for (int i = 0; i < 1000; ++i) {
    EXPECT_GE(noise.next_s(0), last_s);
    last_s = noise.next_s(0);
    noise.take(0);
  }
}

}  // namespace
}  // namespace eventgan
