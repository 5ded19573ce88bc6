#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stages/recordings/event_boundaries_internal.h"

namespace eventgan {
namespace {

// Looks into a list of times and counts how often.
class ListedTimes {
 public:
  explicit ListedTimes(std::vector<double> times) : times_(std::move(times)) {}

  std::int64_t until(double time_s, std::int64_t guess) {
    reads_ = 0;
    return count_events_until(time_s, guess, static_cast<std::int64_t>(times_.size()),
                              [this](std::int64_t first, std::int64_t count) {
                                ++reads_;
                                EXPECT_GT(count, 0);
                                const auto begin = times_.begin() + first;
                                return std::vector<double>(begin, begin + count);
                              });
  }
  int reads() const { return reads_; }

 private:
  std::vector<double> times_;
  int reads_ = 0;
};

TEST(CountEventsUntilTest, CountsEventsAtTheTimeItself) {
  ListedTimes times({1, 2, 2, 3});
  for (const std::int64_t guess : {-5, 0, 2, 4, 1000}) {
    EXPECT_EQ(times.until(0.5, guess), 0);
    EXPECT_EQ(times.until(1, guess), 1);
    EXPECT_EQ(times.until(2, guess), 3);
    EXPECT_EQ(times.until(2.5, guess), 3);
    EXPECT_EQ(times.until(3, guess), 4);
    EXPECT_EQ(times.until(9, guess), 4);
  }
}

TEST(CountEventsUntilTest, NeedsNoEvents) { EXPECT_EQ(ListedTimes({}).until(1, 0), 0); }

TEST(CountEventsUntilTest, NeedsOneReadForAGoodGuessAndFewForABadOne) {
  constexpr std::int64_t kCount = 1'000'000;
  std::vector<double> ascending(kCount);
  for (std::int64_t i = 0; i < kCount; ++i) ascending[static_cast<std::size_t>(i)] = 0.5 * i;
  ListedTimes times(ascending);
  EXPECT_EQ(times.until(0.5 * 123'456, 123'400), 123'457);
  EXPECT_EQ(times.reads(), 1);
  for (const std::int64_t guess : {std::int64_t{0}, kCount / 2, kCount}) {
    EXPECT_EQ(times.until(0.5 * 123'456, guess), 123'457);
    EXPECT_LE(times.reads(), 12);  // 10^6 / 1024 < 2^10
  }
}

TEST(CountEventsUntilTest, EndsForTimesOutOfOrder) {
  std::vector<double> times(10'000);
  for (std::size_t i = 0; i < times.size(); ++i) {
    times[i] = i % 7 == 0 ? std::nan("") : static_cast<double>((i * 7919) % 10'000);
  }
  ListedTimes listed(times);
  for (double time_s = -1; time_s < 10'001; time_s += 97) {
    const std::int64_t count = listed.until(time_s, 5000);
    EXPECT_GE(count, 0);
    EXPECT_LE(count, 10'000);
  }
}

TEST(EventBoundariesTest, AsksOnceForEachFrame) {
  const EventBoundaries boundaries(2);
  int searches = 0;
  const auto search = [&] {
    ++searches;
    return std::int64_t{0};
  };
  EXPECT_EQ(boundaries.at(1, search), 0);
  EXPECT_EQ(boundaries.at(1, search), 0);
  EXPECT_EQ(searches, 1);
  EXPECT_EQ(boundaries.at(0, [] { return std::int64_t{5}; }), 5);
}

}  // namespace
}  // namespace eventgan
