#include "stages/recordings/readers/detail/event_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "manifests/values/faults.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

CompactEvents compact(const std::vector<StoredEvent>& events) {
  CompactEvents result;
  for (const StoredEvent& event : events) result.push_back(event);
  return result;
}

CompactEvents events_at(const std::vector<double>& times_s) {
  CompactEvents result;
  for (const double time_s : times_s) result.push_back({1, 2, time_s, 1});
  return result;
}

TEST(CompactEvents, HoldAnyNumbers) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<StoredEvent> events = {
      {0, 32'767, 0.1, 1}, {1.5, 0, -3, 1},    {-32'768, 0, 1e300, -1},
      {32'768, 2, 3, 0},   {3, -40'000, 4, 0}, {3, 4, 5, 1e300},
      {1, 2, 6, -128},     {1, 2, 7, -129},    {1, 2, nan, 127},
      {nan, nan, 8, nan},  {5, 6, 9, 0}};
  const CompactEvents kept = compact(events);
  ASSERT_EQ(kept.size(), std::ssize(events));
  const auto same = [](double a, double b) { return a == b || (std::isnan(a) && std::isnan(b)); };
  for (std::size_t i = 0; i < events.size(); ++i) {
    const StoredEvent event = kept[static_cast<std::int64_t>(i)];
    EXPECT_TRUE(same(event.x, events[i].x) && same(event.y, events[i].y) &&
                same(event.t_s, events[i].t_s) && same(event.polarity, events[i].polarity))
        << i;
    EXPECT_TRUE(same(kept.times_s()[i], events[i].t_s)) << i;
  }
}

TEST(CompactEvents, TimesOfAnyNumbersAreDivided) {
  CompactEvents kept = compact({{0, 0, 3e6, 1}, {1.5, 0, 4e6, 1}, {2, 0, 5e6, 300}});
  kept.divide_times(1e6);
  EXPECT_THAT(kept.times_s(), ElementsAre(3, 4, 5));
  for (const std::int64_t i : {0, 1, 2}) EXPECT_EQ(kept[i].t_s, 3 + static_cast<double>(i));
}

/// Three parts, of times 1, 2, 2; 3; 5, 6 s.
class TestParts final : public EventParts {
 public:
  explicit TestParts(RecentEvents& recent) : EventParts("FILE", recent) {
    for (const auto& times_s : parts)
      add_part(std::ssize(times_s), times_s.front(), times_s.back());
  }

  std::vector<std::vector<double>> parts = {{1, 2, 2}, {3}, {5, 6}};
  mutable std::vector<std::size_t> reads;

 private:
  CompactEvents read_part(std::size_t part) const override {
    reads.push_back(part);
    return events_at(parts[part]);
  }
};

std::vector<double> times_of(const std::vector<StoredEvent>& events) {
  std::vector<double> times_s;
  for (const StoredEvent& event : events) times_s.push_back(event.t_s);
  return times_s;
}

TEST(EventParts, AreReadWhereTheyAreAskedForAndOnce) {
  RecentEvents recent(100);
  const TestParts events(recent);
  EXPECT_EQ(events.count(), 6);
  EXPECT_THAT(events.reads, IsEmpty());
  EXPECT_THAT(times_of(events.read(1, 2)), ElementsAre(2, 2));
  EXPECT_THAT(events.reads, ElementsAre(0));
  EXPECT_THAT(events.times_s(2, 3), ElementsAre(2, 3, 5));
  EXPECT_THAT(times_of(events.read(0, 6)), ElementsAre(1, 2, 2, 3, 5, 6));
  EXPECT_THAT(times_of(events.read(6, 0)), IsEmpty());
  EXPECT_THAT(events.reads, ElementsAre(0, 1, 2));
}

TEST(EventParts, TellInWhichPartTheEventsBehindATimeBegin) {
  RecentEvents recent(100);
  const TestParts events(recent);
  const std::pair<double, std::int64_t> expected[] = {{0.5, 0}, {1, 0}, {1.5, 0}, {2, 3}, {2.5, 3},
                                                      {3, 4},   {4, 4}, {5, 4},   {6, 6}, {9, 6}};
  for (const auto& [time_s, begin] : expected) {
    EXPECT_EQ(events.order().block_after(time_s).begin, begin) << time_s;
  }
  EXPECT_EQ(events.order().span(), (std::array{1.0, 6.0}));
  EXPECT_THAT(events.reads, IsEmpty());
}

TEST(EventParts, ThatAreNotAsTheyWereAreRefused) {
  RecentEvents recent(100);
  TestParts events(recent);
  events.parts[1].push_back(4);
  EXPECT_THAT(times_of(events.read(0, 3)), ElementsAre(1, 2, 2));
  EXPECT_THAT([&] { events.read(2, 2); },
              ThrowsMessage<InputError>("expected 1 events as before, got 2, in FILE"));
}

TEST(EventParts, ThoseUsedLongestAgoGo) {
  RecentEvents recent(4);
  const TestParts events(recent);
  events.read(0, 4);  // parts 0 and 1: four events
  events.read(0, 1);
  events.read(4, 1);  // part 2 of two: part 1 goes, then part 0
  EXPECT_THAT(events.reads, ElementsAre(0, 1, 2));
  events.read(4, 2);
  events.read(3, 1);
  EXPECT_THAT(events.reads, ElementsAre(0, 1, 2, 1));
  events.read(0, 1);
  EXPECT_THAT(events.reads, ElementsAre(0, 1, 2, 1, 0));
  events.read(3, 1);
  EXPECT_THAT(events.reads, ElementsAre(0, 1, 2, 1, 0));
}

TEST(EventParts, TheLatestStaysHoweverLargeItIs) {
  RecentEvents recent(1);
  const TestParts events(recent);
  events.read(0, 1);
  events.read(1, 2);
  EXPECT_THAT(events.reads, ElementsAre(0));
}

}  // namespace
}  // namespace eventgan
