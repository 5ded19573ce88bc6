#include "stages/recordings/order/time_order.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "manifests/values/faults.h"
#include "stages/recordings/order/event_check.h"
#include "stages/recordings/readers/detail/stored_recording.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::Each;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Pair;
using ::testing::SizeIs;
using ::testing::ThrowsMessage;

constexpr double kNoTime = std::numeric_limits<double>::quiet_NaN();
constexpr double kNever = std::numeric_limits<double>::infinity();

TimeOrder order_of(const std::vector<double>& times_s) {
  TimeOrder order;
  order.add_all(times_s, 0);
  return order;
}

bool touches_fall(const TimeOrder& order, double after_s, double until_s) {
  return order.fall_in(after_s, until_s) != nullptr;
}

/// What is wrong with the events up to a time, at which place.
std::pair<std::string, std::int64_t> fault_of(const TimeOrder& order, double after_s,
                                              double until_s) {
  std::pair<std::string, std::int64_t> found;
  require_order(order, after_s, until_s, [&](const EventFault& fault, std::int64_t place) {
    found = {fault.what(), place};
  });
  return found;
}

TEST(TimeOrder, OfNoEventsHasNoSpan) {
  EXPECT_EQ(order_of({}).span(), std::nullopt);
  EXPECT_EQ(order_of({kNoTime, kNever}).span(), std::nullopt);
  EXPECT_EQ(order_of({}).block_after(0).end, 0);
  EXPECT_FALSE(touches_fall(order_of({}), -1, 1));
}

TEST(TimeOrder, EqualTimesAreNoFall) {
  const TimeOrder order = order_of({1, 2, 2, kNoTime, 2, 3});
  EXPECT_THAT(order.falls(), IsEmpty());
  EXPECT_EQ(order.span(), (std::array{1.0, 3.0}));
}

TEST(TimeOrder, AnExchangedPairIsAFallOfItsOwn) {
  const TimeOrder order = order_of({1, 2, 4, 3, 5, 6});
  ASSERT_THAT(order.falls(), SizeIs(1));
  EXPECT_THAT(fault_of(order, 0, 3), Pair(HasSubstr("got 3 s after 4 s"), 3));
  EXPECT_THAT(fault_of(order, 0, 2.5), Pair(IsEmpty(), 0));
  EXPECT_FALSE(touches_fall(order, 0, 2.5));
  EXPECT_TRUE(touches_fall(order, 0, 3));
  EXPECT_TRUE(touches_fall(order, 3, 3.5));
  EXPECT_TRUE(touches_fall(order, 3.5, 5));
  EXPECT_FALSE(touches_fall(order, 4, 5));
}

TEST(TimeOrder, ARecordingBehindAnotherFallsThroughout) {
  const TimeOrder order = order_of({1, 2, 3, 1, 2, 3});
  ASSERT_THAT(order.falls(), SizeIs(1));
  EXPECT_TRUE(touches_fall(order, 0, 1));
  EXPECT_TRUE(touches_fall(order, 2.5, 9));
  EXPECT_FALSE(touches_fall(order, 3, 9));
}

TEST(TimeOrder, WhatCouldNotBeReadMayBeAnyTime) {
  TimeOrder order;
  order.add_all(std::vector<double>{1, 2}, 0);
  order.add_unreadable(std::make_exception_ptr(InputError("damage")));
  order.end_block(4);
  EXPECT_TRUE(touches_fall(order, 2, 100));
  order.add_all(std::vector<double>{5, 6}, 4);
  EXPECT_FALSE(touches_fall(order, 0, 1.5));
  EXPECT_TRUE(touches_fall(order, 1.5, 2));
  EXPECT_TRUE(touches_fall(order, 3, 4));
  EXPECT_FALSE(touches_fall(order, 5, 7));
  EXPECT_THAT([&] { fault_of(order, 3, 4); }, ThrowsMessage<InputError>("damage"));
  EXPECT_EQ(order.to_bytes(), std::nullopt);
}

TEST(TimeOrder, WhatCouldNotBeReadIsNotKeptEvenWithinAFall) {
  TimeOrder order;
  order.add_all(std::vector<double>{1, 5, 3}, 0);
  EXPECT_NE(order.to_bytes(), std::nullopt);
  order.add_unreadable(std::make_exception_ptr(InputError("damage")));
  order.end_block(6);
  EXPECT_EQ(order.to_bytes(), std::nullopt);
}

TEST(TimeOrder, TooManyFallsAreTakenTogether) {
  std::vector<double> times;
  constexpr int kPairs = 100'000;
  for (int i = 0; i < kPairs; ++i) times.insert(times.end(), {3.0 * i + 1, 3.0 * i});
  const TimeOrder order = order_of(times);
  EXPECT_LE(order.falls().size(), 65'536u);
  for (int i = 0; i < kPairs; i += 99) EXPECT_TRUE(touches_fall(order, 3.0 * i, 3.0 * i + 0.5));
}

TEST(TimeOrder, LiftsWhatStepsBackByLessThanTwoMilliseconds) {
  struct Case {
    std::vector<double> times_ms;
    std::int64_t lifted;
    std::size_t falls;
  };
  for (const Case& each : {Case{{2, 4, 3, 4}, 1, 0},
                           {{2, 4, 2.001, 6}, 1, 0},
                           {{2, 4, 2, 6}, 0, 1},
                           {{10, 8.8, 7.6, 12}, 1, 1},      // each of the latest before it
                           {{2, 18, 10, 17, 20}, 0, 1},     // the fall lasts until 18
                           {{2, 18, 10, 19, 18.2}, 1, 1}})  // there it has ended
  {
    SCOPED_TRACE(::testing::PrintToString(each.times_ms));
    TimeOrder order(kMostLift_s);
    std::vector<double> times_s;
    for (const double time_ms : each.times_ms) times_s.push_back(time_ms / 1000);
    order.add_all(times_s, 0);
    EXPECT_EQ(order.lifted(), each.lifted);
    EXPECT_EQ(order.falls().size(), each.falls);
    EXPECT_EQ(order_of(times_s).lifted(), 0) << "unless it is asked for";
  }
}

/// Events as they are.
class Listed final : public EventStore {
 public:
  explicit Listed(std::vector<double> times_s) : times_s_(std::move(times_s)) {}
  std::int64_t count() const override { return std::ssize(times_s_); }
  std::vector<StoredEvent> read(std::int64_t first, std::int64_t count) const override {
    std::vector<StoredEvent> events;
    for (std::int64_t i = first; i < first + count; ++i) {
      events.push_back({0, 0, times_s_[static_cast<std::size_t>(i)], 1});
    }
    return events;
  }

 private:
  std::vector<double> times_s_;
};

// Whatever is asked for, a time that is lifted is the latest up to it, which the file's order
// tells.
TEST(TimeOrder, EachWindowHasTheLiftedTimes) {
  std::mt19937 random(3);
  std::vector<double> times, latest;
  for (int i = 0; i < 30'000; ++i) {
    times.push_back((50.0 * i + static_cast<double>(random() % 1900)) / 1e6);
    latest.push_back(i == 0 ? times[0] : std::max(latest.back(), times.back()));
  }
  const auto recording = make_stored_recording(
      {.name = "FILE", .size = {1, 1}, .events = std::make_unique<Listed>(times)});
  const auto expect = [&](const std::vector<Event>& events, std::ptrdiff_t begin,
                          std::ptrdiff_t end) {
    std::vector<double> found(events.size());
    std::ranges::transform(events, found.begin(), &Event::t_s);
    EXPECT_EQ(found, std::vector(latest.begin() + begin, latest.begin() + end)) << begin;
  };
  for (double after_s = -0.01; after_s < 1.6; after_s += 0.0417) {
    const auto begin = std::ranges::upper_bound(latest, after_s) - latest.begin();
    const auto end = std::ranges::upper_bound(latest, after_s + 0.05) - latest.begin();
    expect(recording->events_in(after_s, after_s + 0.05), begin, end);
    expect(recording->events_around(after_s, 100, 50), std::max<std::ptrdiff_t>(begin - 100, 0),
           std::min<std::ptrdiff_t>(begin + 50, std::ssize(latest)));
  }
  EXPECT_EQ(recording->event_span(), (std::array{latest.front(), latest.back()}));
  std::size_t lifted = 0;
  for (std::size_t i = 0; i < times.size(); ++i) lifted += times[i] < latest[i] ? 1 : 0;
  EXPECT_THAT(recording->notes(),
              ::testing::ElementsAre(HasSubstr(std::to_string(lifted) + " are lifted")));
}

// Whatever is exchanged: a window has all events of its time, or it is refused; and those that
// touch no exchanged time are not.
TEST(TimeOrder, NoWindowLosesAnEventInSilence) {
  std::mt19937 random(7);
  for (int trial = 0; trial < 12; ++trial) {
    std::vector<double> times;
    for (int i = 0; i < 20'000; ++i) times.push_back(0.001 * (i / (1 + trial % 3)));
    double first_s = kNever, last_s = -kNever;  // of what lies elsewhere
    for (int swaps = trial % 4; swaps > 0; --swaps) {
      const std::size_t length = trial % 2 == 0 ? 1 : random() % 4'500;
      const std::size_t a = random() % 5'000, b = 10'000 + random() % 5'000;
      first_s = std::min(first_s, times[a]);
      last_s = std::max(last_s, times[b + length]);
      std::swap_ranges(times.begin() + static_cast<std::ptrdiff_t>(a),
                       times.begin() + static_cast<std::ptrdiff_t>(a + length),
                       times.begin() + static_cast<std::ptrdiff_t>(b));
    }
    const auto recording = make_stored_recording(
        {.name = "FILE", .size = {1, 1}, .events = std::make_unique<Listed>(times)});
    const auto [least, most] = std::ranges::minmax(times);
    EXPECT_EQ(recording->event_span(), (std::array{least, most}));
    for (double after_s = -0.3; after_s < most; after_s += 0.7) {
      const double until_s = after_s + 0.7;
      const auto expected = std::ranges::count_if(
          times, [&](double time_s) { return time_s > after_s && time_s <= until_s; });
      try {
        const std::vector<Event> events = recording->events_in(after_s, until_s);
        EXPECT_EQ(std::ssize(events), expected) << trial << " " << after_s;
        EXPECT_THAT(events, Each(Field(&Event::t_s,
                                       AllOf(::testing::Gt(after_s), ::testing::Le(until_s)))));
      } catch (const InputError& error) {
        EXPECT_THAT(error.what(), AllOf(HasSubstr("never decrease"), HasSubstr("in FILE (event ")));
        EXPECT_TRUE(until_s >= first_s && after_s <= last_s) << trial << " " << after_s;
      }
      try {
        const std::vector<Event> events = recording->events_around(until_s, 500, 500);
        EXPECT_TRUE(std::ranges::is_sorted(events, {}, &Event::t_s));
        const auto inside = std::ranges::count_if(times, [&](double time_s) {
          return time_s > events.front().t_s && time_s < events.back().t_s;
        });
        EXPECT_LE(inside, std::ssize(events)) << trial << " " << until_s;
      } catch (const InputError&) {
      }
    }
  }
}

}  // namespace
}  // namespace eventgan
