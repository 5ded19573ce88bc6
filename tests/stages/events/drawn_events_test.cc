#include "stages/events/drawn_events.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <vector>

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

TEST(DrawEvents, WholeRatesAreTheEvents) {
  const VolumeShape shape{3, {7, 301}};
  EXPECT_THAT(drawn(std::vector<float>(shape.value_count(), 2.0f), shape, 1), Each(2.0f));
}

TEST(DrawEvents, MeanIsTheRate) {
  const VolumeShape shape{2, {100, 100}};
  const std::size_t plane = shape.size.pixel_count();
  const std::vector<float> rates{0.3f, 1.25f, 0.0f, 0.01f};  // by channel
  std::vector<float> volume;
  for (const float rate : rates) volume.insert(volume.end(), plane, rate);
  const std::vector<float> events = drawn(volume, shape, 3);
  for (std::size_t channel = 0; channel < rates.size(); ++channel) {
    const auto first = events.begin() + static_cast<std::ptrdiff_t>(channel * plane);
    const double mean =
        std::accumulate(first, first + static_cast<std::ptrdiff_t>(plane), 0.0) / double(plane);
    // The variance of a number between two whole ones is at most p (1 - p), twice that of two sums.
    const double part = rates[channel] - std::floor(rates[channel]);
    EXPECT_NEAR(mean, rates[channel], 4 * std::sqrt((part * (1 - part) + 0.25) / double(plane)));
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
  for (std::size_t i = 0; i < 2 * plane; ++i) {
    double expected = 0, made = 0;
    for (std::size_t bin = 0; bin < 9; ++bin) {
      const std::size_t at = (i / plane * 9 + bin) * plane + i % plane;
      expected += rates[at];
      made += events[at];
      ASSERT_EQ(events[at], std::floor(events[at]));
      ASSERT_GE(events[at], 0);
    }
    ASSERT_LT(std::abs(made - expected), 1 + 1e-4) << i;
  }
}

TEST(DrawEvents, SeedDecides) {
  const VolumeShape shape{9, {8, 8}};
  const std::vector<float> rates(shape.value_count(), 0.2f);
  EXPECT_EQ(drawn(rates, shape, 1), drawn(rates, shape, 1));
  EXPECT_NE(drawn(rates, shape, 1), drawn(rates, shape, 2));
}

TEST(DrawEvents, PixelsAndPolaritiesAreIndependent) {
  const VolumeShape shape{1, {100, 100}};
  const std::size_t plane = shape.size.pixel_count();
  const std::vector<float> events = drawn(std::vector<float>(shape.value_count(), 0.5f), shape, 11);
  int both = 0, neighbours = 0;
  for (std::size_t i = 0; i + 1 < plane; ++i) {
    both += events[i] > 0 && events[plane + i] > 0;
    neighbours += events[i] > 0 && events[i + 1] > 0;
  }
  const double spread = std::sqrt(plane * 0.25 * 0.75);
  EXPECT_NEAR(both, 0.25 * plane, 4 * spread);
  EXPECT_NEAR(neighbours, 0.25 * plane, 4 * spread);
}

TEST(DrawEvents, WhatIsNotFiniteStaysSo) {
  const VolumeShape shape{2, {1, 2}};
  std::vector<float> rates(shape.value_count(), 0.5f);
  rates[1] = std::numeric_limits<float>::quiet_NaN();
  rates[4] = std::numeric_limits<float>::infinity();
  const std::vector<float> events = drawn(rates, shape, 1);
  EXPECT_FALSE(std::isfinite(events[1]));
  EXPECT_FALSE(std::isfinite(events[4]));
  EXPECT_TRUE(std::isfinite(events[0]));
}

TEST(DrawEvents, HugeRatesStayWhole) {
  const VolumeShape shape{9, {1, 1}};
  EXPECT_THAT(drawn(std::vector<float>(18, 1e30f), shape, 1), Each(1e30f));
}

TEST(DrawEvents, RefusesAnotherSize) {
  std::vector<float> rates(17);
  EXPECT_THROW(draw_events(rates, {9, {1, 1}}, CounterRandom(1)), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
