#include "manifests/values/poisson_random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace eventgan {
namespace {

TEST(LogFactorial, IsTheLogarithmOfTheProduct) {
  double product = 1;
  EXPECT_NEAR(log_factorial(0), 0, 1e-10);
  for (int k = 1; k <= 25; ++k) {
    product *= k;
    EXPECT_NEAR(log_factorial(k), std::log(product), 1e-10) << k;
  }
}

TEST(Poisson, HasItsMeanAndVariance) {
  constexpr int kDraws = 20000;
  for (const double mean : {0.01, 1.0, 15.9, 16.1, 300.0, 34e3, 1e12}) {
    double sum = 0, squares = 0;
    for (int i = 0; i < kDraws; ++i) {
      const CounterRandom random = CounterRandom(5).keyed(std::to_string(i));
      const double off = poisson(mean, random, 0) - mean;
      sum += off;
      squares += off * off;
    }
    // Five standard deviations: the variance of a draw is the mean m, of its square m + 2 m^2.
    EXPECT_NEAR(sum / kDraws, 0, 5 * std::sqrt(mean / kDraws)) << mean;
    EXPECT_NEAR(squares / kDraws, mean, 5 * std::sqrt((mean + 2 * mean * mean) / kDraws)) << mean;
  }
}

TEST(Poisson, IsDistributedAsItIsDefined) {
  constexpr int kDraws = 100000, kMost = 60;
  for (const double mean : {2.5, 16.5}) {  // by inversion, by rejection
    std::vector<int> found(kMost + 1);
    for (int i = 0; i < kDraws; ++i) {
      const CounterRandom random = CounterRandom(6).keyed(std::to_string(i));
      const double count = poisson(mean, random, 0);
      ASSERT_EQ(count, std::floor(count));
      ASSERT_LE(count, kMost);
      ++found[static_cast<std::size_t>(count)];
    }
    for (int k = 0; k <= kMost; ++k) {
      const double p = std::exp(k * std::log(mean) - mean - std::lgamma(k + 1));
      // Five standard deviations, and one draw where hardly any is expected.
      EXPECT_NEAR(found[static_cast<std::size_t>(k)], kDraws * p, 5 * std::sqrt(kDraws * p) + 1)
          << k << " of mean " << mean;
    }
  }
}

TEST(Poisson, OfNothingIsNothingAndTakesItsCountersAlone) {
  EXPECT_EQ(poisson(0, CounterRandom(1), 0), 0);
  for (const double mean : {1e16, 1e100, 1e300}) {
    EXPECT_NEAR(poisson(mean, CounterRandom(1), 0) / mean, 1, 1e-6) << mean;
  }
  // Draws that are told apart by their first counter, with a stride: none shares a counter.
  const CounterRandom random(9);
  EXPECT_EQ(poisson(3, random, 4, 10), poisson(3, random, 4, 99)) << "one counter";
  double sum = 0;
  for (std::uint64_t place = 0; place < 1000; ++place) sum += poisson(50, random, place, 1000);
  EXPECT_NEAR(sum, 50e3, 5 * std::sqrt(50e3));
}

}  // namespace
}  // namespace eventgan
