#include "stages/exports/sampled_events.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "manifests/values/faults.h"
#include "stages/events/event_volume.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

const VolumeShape kShape{9, {7, 11}};

/// Whole numbers, mostly zero, with events in the first and the last bin.
std::vector<float> whole_numbers(int most) {
  const CounterRandom random(3);
  std::vector<float> volume(kShape.value_count());
  for (std::size_t i = 0; i < volume.size(); ++i) {
    const auto drawn = static_cast<int>(random.below(i, 2 * static_cast<std::uint64_t>(most) + 2));
    volume[i] = static_cast<float>(std::max(0, drawn - most - 1));
  }
  volume.front() = volume.back() = 1;
  return volume;
}

float largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  float largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

TEST(SampleEvents, RoundedCountsAreWithinHalfAnEvent) {
  const auto difference = [](const std::vector<float>& volume) {
    return largest_difference(
        event_volume(sample_events(volume, kShape, 0.1, EventCounts::kRounded, CounterRandom(1)),
                     kShape),
        volume);
  };
  for (const int most : {1, 4, 30}) {
    EXPECT_LT(difference(whole_numbers(most)), 1e-4f * (1 + most)) << "whole numbers come back";
  }
  std::vector<float> volume = whole_numbers(3);
  const CounterRandom random(9);
  for (std::size_t i = 1; i + 1 < volume.size(); ++i) {
    volume[i] += static_cast<float>(random.uniform(i));
  }
  EXPECT_LT(difference(volume), 0.5f + 1e-3f);
}

TEST(SampleEvents, PoissonCountsGiveTheVolumeInTheMean) {
  constexpr int kDraws = 2000;
  const VolumeShape shape{3, {2, 2}};
  // The corners are large, so that there are events in the first and the last bin.
  std::vector<float> volume(shape.value_count(), 0.7f);
  volume.front() = volume.back() = 40;
  std::vector<double> sums(volume.size());
  std::vector<double> squares(volume.size());
  for (int draw = 0; draw < kDraws; ++draw) {
    const auto again = event_volume(sample_events(volume, shape, 1, EventCounts::kPoisson,
                                                  CounterRandom(static_cast<std::uint64_t>(draw))),
                                    shape);
    for (std::size_t i = 0; i < again.size(); ++i) {
      sums[i] += again[i];
      squares[i] += double(again[i]) * again[i];
    }
  }
  for (std::size_t i = 0; i < volume.size(); ++i) {
    const double mean = sums[i] / kDraws;
    // Mean and variance of Poisson's distribution are the value; within four standard errors.
    EXPECT_NEAR(mean, volume[i], 4 * std::sqrt(volume[i] / kDraws)) << i;
    EXPECT_NEAR(squares[i] / kDraws - mean * mean, volume[i], 0.2 * volume[i]) << i;
  }
}

TEST(SampleEvents, AreInOrderWithinTheTimeAndFollowTheSeed) {
  const auto events =
      sample_events(whole_numbers(4), kShape, 0.3, EventCounts::kRounded, CounterRandom(1));
  EXPECT_TRUE(std::ranges::is_sorted(events, {}, &Event::t_s));
  EXPECT_EQ(events.front().t_s, 0);
  EXPECT_EQ(events.back().t_s, 0.3);
  const auto is_between = [](const Event& event) {
    const double bins = event.t_s / 0.3 * 8;
    return std::abs(bins - std::round(bins)) > 1e-6;
  };
  EXPECT_GT(std::ranges::count_if(events, is_between),
            static_cast<std::ptrdiff_t>(events.size() / 4));
  const std::vector<float> volume = whole_numbers(4);
  const auto draw = [&](std::uint64_t seed) {
    return sample_events(volume, kShape, 1, EventCounts::kPoisson, CounterRandom(seed));
  };
  EXPECT_EQ(draw(1), draw(1));
  EXPECT_NE(draw(1), draw(2));
}

TEST(SampleEvents, OfOneBinAndNoEventsAreALineEach) {
  const VolumeShape shape{1, {1, 1}};
  const std::vector<float> volume{2, 0};
  const auto events = sample_events(volume, shape, 1, EventCounts::kRounded, CounterRandom(1));
  EXPECT_EQ(events, (std::vector<Event>{{0, 0, 0, true}, {0, 0, 0, true}}));
  EXPECT_TRUE(
      sample_events(std::vector<float>{0, 0}, shape, 1, EventCounts::kPoisson, CounterRandom(1))
          .empty());
  EXPECT_EQ(events_text(std::vector<Event>{{3, 4, 0.25, true}, {0, 1, 1, false}}),
            "0.250000000 3 4 1\n1.000000000 0 1 0\n");
}

TEST(SampleEvents, RefuseMoreThanCanBeMade) {
  const VolumeShape shape{1, {1, 1}};
  for (const std::vector<float>& volume : std::vector<std::vector<float>>{
           {1e30f, 0}, {8.6e9f, 0}, {6e8f, 6e8f}, {0, std::numeric_limits<float>::max()}}) {
    for (const EventCounts counts : {EventCounts::kPoisson, EventCounts::kRounded}) {
      EXPECT_THROWS(sample_events(volume, shape, 1, counts, CounterRandom(1)), UsageError,
                    "expected values of at most 1e+09 events altogether");
    }
  }
}

}  // namespace
}  // namespace eventgan
