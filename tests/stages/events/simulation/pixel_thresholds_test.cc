#include "stages/events/simulation/pixel_thresholds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace eventgan {
namespace {

constexpr std::size_t kPixels = 20000;

TEST(PixelThresholds, AreGaussian) {
  const std::vector<float> drawn = draw_thresholds(0.5, 0.05, kPixels, CounterRandom(7));
  const double n = kPixels;
  const double mean = std::accumulate(drawn.begin(), drawn.end(), 0.0) / n;
  double squares = 0;
  for (const float value : drawn) squares += (value - mean) * (value - mean);
  const double deviation = std::sqrt(squares / n);
  // Four standard errors each: sigma / sqrt(n), sigma / sqrt(2 n), sqrt(p (1 - p) / n).
  EXPECT_NEAR(mean, 0.5, 4 * 0.05 / std::sqrt(n));
  EXPECT_NEAR(deviation, 0.05, 4 * 0.05 / std::sqrt(2 * n));
  const auto within = [&](double sigmas) {
    return static_cast<double>(std::ranges::count_if(
               drawn, [&](float value) { return std::abs(value - 0.5) < sigmas * 0.05; })) /
           n;
  };
  EXPECT_NEAR(within(1), 0.6827, 4 * std::sqrt(0.6827 * 0.3173 / n));
  EXPECT_NEAR(within(2), 0.9545, 4 * std::sqrt(0.9545 * 0.0455 / n));
}

TEST(PixelThresholds, AreTheMeanWithoutSpread) {
  EXPECT_THAT(draw_thresholds(0.3, 0, 5, CounterRandom(1)), ::testing::Each(0.3f));
}

TEST(PixelThresholds, AreNeverBelowTheSmallest) {
  const std::vector<float> drawn = draw_thresholds(0.02, 1, kPixels, CounterRandom(7));
  EXPECT_EQ(*std::ranges::min_element(drawn), kSmallestThreshold);
  // Half of a Gaussian of spread 1 about 0.02 lies below 0.01, to within 0.01/sqrt(2 pi).
  const auto lowest = std::ranges::count(drawn, kSmallestThreshold);
  EXPECT_NEAR(static_cast<double>(lowest) / kPixels, 0.496, 4 * 0.5 / std::sqrt(double{kPixels}));
}

TEST(PixelThresholds, DependOnTheSeedAlone) {
  EXPECT_EQ(draw_thresholds(0.2, 0.03, 50, CounterRandom(3)),
            draw_thresholds(0.2, 0.03, 50, CounterRandom(3)));
  EXPECT_NE(draw_thresholds(0.2, 0.03, 50, CounterRandom(3)),
            draw_thresholds(0.2, 0.03, 50, CounterRandom(4)));
  EXPECT_TRUE(draw_thresholds(0.2, 0.03, 0, CounterRandom(3)).empty());
}

}  // namespace
}  // namespace eventgan
