#include "manifests/values/gaussian_random.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(Gaussian, IsBoxMullerOfTwoUniformNumbersTimesTheDeviation) {
  // Computed apart in Python from bits() as the header of CounterRandom defines them.
  EXPECT_NEAR(gaussian(CounterRandom(7), 0), -0.39226082138170837, 1e-14);
  EXPECT_NEAR(gaussian(CounterRandom(7), 1, 3), 5.301013211365558, 1e-14);
  const CounterRandom random(7);
  for (std::uint64_t i = 0; i < 1000; ++i) {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - random.uniform(2 * i)));
    const double angle = 2.0 * std::numbers::pi * random.uniform(2 * i + 1);
    EXPECT_EQ(gaussian(random, i), radius * std::cos(angle)) << i;
    EXPECT_EQ(gaussian(random, i, 0.1), 0.1 * radius * std::cos(angle)) << i;
  }
}

TEST(Gaussian, HasMean0AndItsDeviation) {
  const CounterRandom random(3);
  constexpr int kDraws = 20000;
  double sum = 0, squares = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double value = gaussian(random, i, 2);
    sum += value;
    squares += value * value;
  }
  // Five standard deviations: of the mean 2 / sqrt(20000) = 0.014, of the mean square
  // 4 sqrt(2 / 20000) = 0.04.
  EXPECT_NEAR(sum / kDraws, 0, 0.07);
  EXPECT_NEAR(squares / kDraws, 4, 0.2);
}

TEST(NearGaussian, IsAsNearAsItSays) {
  const CounterRandom random(5);
  double largest = 0;
  for (std::uint64_t i = 0; i < 300000; ++i) {
    largest = std::max(largest, std::abs(near_gaussian(random, i) - gaussian(random, i)));
  }
  // The sine's first term left out is (pi/2)^17/17! = 6e-12, at a radius of 5.
  EXPECT_LT(largest, 1e-10);
  EXPECT_LT(largest, kNearGaussianError);
}

}  // namespace
}  // namespace eventgan
