#include "stages/recordings/readers/detail/frame_intervals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

#include "manifests/values/faults.h"
#include "stages/recordings/order/event_check.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(FrameTimesTest, Ascend) {
  EXPECT_NO_THROW(check_frame_times({-1}, "f"));
  EXPECT_NO_THROW(check_frame_times({0, 1, std::nextafter(1.0, 2.0)}, "f"));
  EXPECT_THROWS(check_frame_times({}, "f"), InputError, "at least one frame, got none, in f");
  EXPECT_THROWS(check_frame_times({0, 1, 1}, "f"), InputError, "in f (frame 2)");
  EXPECT_THROWS(check_frame_times({1, 0.5}, "f"), InputError,
                "a time after 1.000000 s, got 0.500000 s");
  for (const double time_s : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_THROWS(check_frame_times({time_s}, "f"), InputError, "a finite time");
  }
}

TEST(FrameRangeTest, GivesPositionsOfFramesThatAreThere) {
  EXPECT_EQ(frame_position(2, 3, "r"), 2u);
  EXPECT_EQ(frame_range(0, 2, 3, "r").last, 2u);
  EXPECT_EQ(frame_range(1, 1, 3, "r").first, 1u);
  for (const std::int64_t index : {-1, 3}) {
    EXPECT_THROWS(frame_position(index, 3, "r"), std::out_of_range, "expected a frame 0..2");
    EXPECT_THROWS(frame_range(0, index, 3, "r"), std::out_of_range, "expected a frame 0..2");
    EXPECT_THROWS(frame_range(index, 2, 3, "r"), std::out_of_range, "expected a frame 0..2");
  }
  EXPECT_THROWS(frame_range(2, 1, 3, "r"), std::out_of_range, "got 2 and 1, in r");
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Images of 4x3 (width x height), events in (1, 2].
EventCheck check() { return {ImageSize{3, 4}, 1.0, 2.0}; }

TEST(EventCheckTest, TakesTheCornersBothEndsOfTheTimeAndZeroForNegativePolarity) {
  EventCheck events = check();
  EXPECT_EQ(events.take({0, 0, std::nextafter(1.0, 2.0), 1}),
            (Event{0, 0, std::nextafter(1.0, 2.0), true}));
  EXPECT_EQ(events.take({3, 2, 1.5, -1}), (Event{3, 2, 1.5, false}));
  EXPECT_EQ(events.take({3, 2, 1.5, -1}), (Event{3, 2, 1.5, false}));  // two at one time
  EXPECT_EQ(events.take({0, 2, 2.0, 1}), (Event{0, 2, 2.0, true}));
  EventCheck of_zeros = check();
  EXPECT_FALSE(of_zeros.take({0, 0, 1.5, 0}).positive);
  EXPECT_TRUE(of_zeros.take({0, 0, 1.5, 1}).positive);
}

TEST(EventCheckTest, RefusesOthers) {
  const auto refuses = [](const StoredEvent& event, const char* words,
                          const std::optional<StoredEvent>& before = std::nullopt) {
    EventCheck events = check();
    if (before) events.take(*before);
    EXPECT_THROWS(events.take(event), EventFault, words);
  };
  refuses({0, 0, 1.5, -1}, "got -1 after 0", StoredEvent{0, 0, 1.5, 0});
  refuses({0, 0, 1.5, 1}, "got 1.5 s after 1.75 s", StoredEvent{0, 0, 1.75, 1});
  for (const double polarity : {2.0, -2.0, 0.5, kNan, kInfinity}) {
    refuses({0, 0, 1.5, polarity}, "expected polarities");
  }
  for (const double x : {-1.0, 4.0, 0.5, 1e300, kNan, kInfinity, -kInfinity}) {
    refuses({x, 0, 1.5, 1}, "expected a pixel of an image of 4x3");
  }
  refuses({0, 3, 1.5, 1}, "got x = 0, y = 3");
  refuses({0, 0, 1.0, 1}, "expected a time after 1 s, got the same");
  refuses({0, 0, 2.5, 1}, "got 2.5 s before an event at or before 2 s");
  for (const double time_s : {kNan, kInfinity, -kInfinity}) {
    refuses({0, 0, time_s, 1}, "expected a finite time");
  }
}

}  // namespace
}  // namespace eventgan
