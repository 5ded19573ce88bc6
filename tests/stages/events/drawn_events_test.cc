#include "stages/events/drawn_events.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::Each;

std::vector<float> drawn(std::vector<float> rates, const VolumeShape& shape, std::uint64_t seed) {
  draw_events(rates, shape, CounterRandom(seed));
  return rates;
}

TEST(DrawEvents, NothingComesOfNothing) {
  const VolumeShape shape{9, {3, 5}};
  EXPECT_THAT(drawn(std::vector<float>(shape.value_count()), shape, 1), Each(0.0f));
  EXPECT_TRUE(drawn({}, {9, {0, 0}}, 1).empty());
}

/// Of pixel 0's polarity, over time.
double sum_of(const std::vector<float>& volume, const VolumeShape& shape, std::size_t pixel,
              int polarity) {
  double sum = 0;
  for (int bin = 0; bin < shape.bins; ++bin) {
    const auto channel = static_cast<std::size_t>(polarity * shape.bins + bin);
    sum += volume[channel * shape.size.pixel_count() + pixel];
  }
  return sum;
}

TEST(DrawEvents, AnEventLiesWhereTheSumPassesAWholeNumber) {
  // All of a rate of 1 in one bin: one event, anywhere in it, shared by the bins next to its time.
  const VolumeShape shape{3, {40, 40}};
  const std::size_t plane = shape.size.pixel_count();
  std::vector<float> rates(shape.value_count());
  std::fill_n(rates.begin() + static_cast<std::ptrdiff_t>(plane), plane, 1.0f);
  const std::vector<float> events = drawn(rates, shape, 1);
  double early = 0, late = 0;
  for (std::size_t i = 0; i < plane; ++i) {
    ASSERT_NEAR(sum_of(events, shape, i, 0), 1, 1e-6);
    ASSERT_EQ(sum_of(events, shape, i, 1), 0);
    ASSERT_GE(events[plane + i], 0.5f);
    early += events[i];
    late += events[2 * plane + i];
  }
  // Times are uniform in 0.5..1.5, so an eighth goes to either side: ∫ (1/2 - s) ds over 0..1/2.
  const double bound = 4 * std::sqrt(0.0260 / double(plane));  // the variance of max(0, 1/2 - s)
  EXPECT_NEAR(early / double(plane), 0.125, bound);
  EXPECT_NEAR(late / double(plane), 0.125, bound);
}

TEST(DrawEvents, EvenRatesStayEven) {
  // What a camera sees of a steady change: end bins get half of what others do.
  const VolumeShape shape{5, {100, 100}};
  const std::size_t plane = shape.size.pixel_count();
  std::vector<float> rates(shape.value_count(), 0.4f);
  for (const std::size_t channel : {0, 4, 5, 9}) {
    std::fill_n(rates.begin() + static_cast<std::ptrdiff_t>(channel * plane), plane, 0.2f);
  }
  const std::vector<float> events = drawn(rates, shape, 3);
  for (std::size_t channel = 0; channel < 10; ++channel) {
    const auto first = events.begin() + static_cast<std::ptrdiff_t>(channel * plane);
    const double mean =
        std::accumulate(first, first + static_cast<std::ptrdiff_t>(plane), 0.0) / double(plane);
    // At most one event a bin, of at most 1: the variance is at most p (1 - p).
    EXPECT_NEAR(mean, rates[channel * plane], 4 * std::sqrt(0.24 / double(plane))) << channel;
  }
}

TEST(DrawEvents, SumOverTimeIsWithinOneOfTheRates) {
  const VolumeShape shape{9, {13, 77}};
  const std::size_t plane = shape.size.pixel_count();
  std::vector<float> rates(shape.value_count());
  const CounterRandom random(5);
  for (std::size_t i = 0; i < rates.size(); ++i) {
    rates[i] = static_cast<float>(3 * std::pow(random.uniform(i), 4));
  }
  const std::vector<float> events = drawn(rates, shape, 7);
  for (std::size_t i = 0; i < plane; ++i) {
    for (const int polarity : {0, 1}) {
      const double made = sum_of(events, shape, i, polarity);
      ASSERT_NEAR(made, std::round(made), 1e-5);
      ASSERT_LT(std::abs(made - sum_of(rates, shape, i, polarity)), 1 + 1e-4) << i;
    }
  }
  for (const float value : events) ASSERT_GE(value, 0);
}

TEST(DrawEvents, OneBinCounts) {
  const VolumeShape shape{1, {3, 3}};
  EXPECT_THAT(drawn(std::vector<float>(18, 2.0f), shape, 1), Each(2.0f));
}

TEST(DrawEvents, SeedDecides) {
  const VolumeShape shape{9, {8, 8}};
  const std::vector<float> rates(shape.value_count(), 0.2f);
  EXPECT_EQ(drawn(rates, shape, 1), drawn(rates, shape, 1));
  EXPECT_NE(drawn(rates, shape, 1), drawn(rates, shape, 2));
}

/// Of a polarity at a place, of events in one bin.
int count_at(const std::vector<float>& events, const VolumeShape& shape, int polarity, int y,
             int x) {
  const std::size_t pixel = static_cast<std::size_t>(y) * shape.size.width + x;
  return static_cast<int>(events[polarity * shape.size.pixel_count() + pixel]);
}

/// Of the pixels of a square whose upper left one is at (y, x).
int count_in(const std::vector<float>& events, const VolumeShape& shape, int polarity, int y, int x,
             int side) {
  int count = 0;
  for (int i = 0; i < side * side; ++i) {
    count += count_at(events, shape, polarity, y + i / side, x + i % side);
  }
  return count;
}

TEST(DrawEvents, NeighboursShareWhatIsExpectedOfThemTogether) {
  const VolumeShape shape{1, {14, 301}};  // neither side a multiple of 4, and more than one piece
  const auto of_rate = [&](float rate) {
    return drawn(std::vector<float>(shape.value_count(), rate), shape, 5);
  };
  const auto sixteenth = of_rate(1.0f / 16), quarter = of_rate(0.25f), most = of_rate(1.75f);
  for (const int polarity : {0, 1}) {
    for (int y = 0; y + 4 <= shape.size.height; y += 4) {
      for (int x = 0; x + 4 <= shape.size.width; x += 4) {
        ASSERT_EQ(count_in(sixteenth, shape, polarity, y, x, 4), 1) << y << " " << x;
      }
    }
    for (int y = 0; y + 2 <= shape.size.height; y += 2) {
      for (int x = 0; x + 2 <= shape.size.width; x += 2) {
        ASSERT_EQ(count_in(quarter, shape, polarity, y, x, 2), 1) << y << " " << x;
        ASSERT_EQ(count_in(most, shape, polarity, y, x, 2), 7) << y << " " << x;
      }
    }
  }
}

TEST(DrawEvents, PolaritiesAndBlocksAreIndependent) {
  const VolumeShape shape{1, {100, 100}};
  const std::vector<float> events = drawn(std::vector<float>(shape.value_count(), 0.5f), shape, 11);
  int both = 0, next = 0, below = 0;
  for (int y = 0; y < 96; ++y) {
    for (int x = 0; x < 96; ++x) {
      const int here = count_at(events, shape, 0, y, x);
      both += here * count_at(events, shape, 1, y, x);
      next += here * count_at(events, shape, 0, y, x + 4);
      below += here * count_at(events, shape, 0, y + 4, x);
    }
  }
  // Events of two blocks are at the same 8 of 16 pixels, or at the other 8, with even chances.
  const double pixels = 96 * 96, spread = std::sqrt(pixels / 16) * 16 * 0.25;
  for (const int count : {both, next, below}) EXPECT_NEAR(count, pixels / 4, 4 * spread);
}

TEST(DrawEvents, EachPixelsPhaseIsUniform) {
  const VolumeShape shape{1, {5, 6}};  // a whole block and parts of others
  constexpr int kSeeds = 4000;
  std::vector<double> events(shape.value_count());
  for (int seed = 0; seed < kSeeds; ++seed) {
    const auto volume = drawn(std::vector<float>(shape.value_count(), 0.3f), shape, seed);
    std::ranges::transform(events, volume, events.begin(), std::plus());
  }
  // 60 values of a standard deviation each: 5 of it are passed by chance once in 30,000 times.
  const double bound = 5 * std::sqrt(0.3 * 0.7 / kSeeds);
  for (const double count : events) EXPECT_NEAR(count / kSeeds, 0.3, bound);
}

TEST(DrawEvents, WhatIsNotFiniteStaysSoAndHugeRatesStayWhole) {
  const VolumeShape shape{2, {1, 2}};
  std::vector<float> rates(shape.value_count(), 0.5f);
  rates[1] = std::numeric_limits<float>::quiet_NaN();
  rates[4] = std::numeric_limits<float>::infinity();
  const std::vector<float> events = drawn(rates, shape, 1);
  EXPECT_FALSE(std::isfinite(events[1]));
  EXPECT_FALSE(std::isfinite(events[4]));
  EXPECT_TRUE(std::isfinite(events[0]));
  rates = std::vector<float>(17);
  EXPECT_THROWS(draw_events(rates, {9, {1, 1}}, CounterRandom(1)), std::invalid_argument,
                "expected 18 values of a volume, got 17");
}

TEST(DrawEvents, HugeRatesStayWhole) {
  const VolumeShape shape{9, {1, 1}};
  EXPECT_THAT(drawn(std::vector<float>(18, 1e30f), shape, 1), Each(1e30f));
}

}  // namespace
}  // namespace eventgan
