#include "stages/recordings/readers/detail/frame_intervals.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "manifests/values/faults.h"
#include "stages/recordings/order/event_check.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(FrameTimesTest, TakesAscendingTimes) {
  EXPECT_NO_THROW(check_frame_times({-1}, "f"));
  EXPECT_NO_THROW(check_frame_times({0, 1, std::nextafter(1.0, 2.0)}, "f"));
}

TEST(FrameTimesTest, RefusesOthers) {
  EXPECT_THAT([] { check_frame_times({}, "f"); },
              ThrowsMessage<InputError>(HasSubstr("at least one frame, got none, in f")));
  EXPECT_THAT(
      [] {
        check_frame_times({0, 1, 1}, "f");
      },
      ThrowsMessage<InputError>(HasSubstr("in f (frame 2)")));
  EXPECT_THAT(
      [] {
        check_frame_times({1, 0.5}, "f");
      },
      ThrowsMessage<InputError>(HasSubstr("a time after 1.000000 s, got 0.500000 s")));
  for (const double time_s : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_THAT([&] { check_frame_times({time_s}, "f"); },
                ThrowsMessage<InputError>(HasSubstr("a finite time")));
  }
}

TEST(FrameRangeTest, GivesPositions) {
  EXPECT_EQ(frame_position(2, 3, "r"), 2u);
  EXPECT_EQ(frame_range(0, 2, 3, "r").last, 2u);
  EXPECT_EQ(frame_range(1, 1, 3, "r").first, 1u);
}

TEST(FrameRangeTest, RefusesFramesThatAreNotThere) {
  for (const std::int64_t index : {-1, 3}) {
    EXPECT_THAT([&] { frame_position(index, 3, "r"); },
                ThrowsMessage<std::out_of_range>(HasSubstr("expected a frame 0..2")));
    EXPECT_THROW(frame_range(0, index, 3, "r"), std::out_of_range);
    EXPECT_THROW(frame_range(index, 2, 3, "r"), std::out_of_range);
  }
  EXPECT_THAT([] { frame_range(2, 1, 3, "r"); },
              ThrowsMessage<std::out_of_range>(HasSubstr("got 2 and 1, in r")));
}

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Images of 4x3 (width x height), events in (1, 2].
EventCheck check() { return {ImageSize{3, 4}, 1.0, 2.0}; }

TEST(EventCheckTest, TakesTheCornersAndBothEndsOfTheTime) {
  EventCheck events = check();
  EXPECT_EQ(events.take({0, 0, std::nextafter(1.0, 2.0), 1}),
            (Event{0, 0, std::nextafter(1.0, 2.0), true}));
  EXPECT_EQ(events.take({3, 2, 1.5, -1}), (Event{3, 2, 1.5, false}));
  EXPECT_EQ(events.take({3, 2, 1.5, -1}), (Event{3, 2, 1.5, false}));  // two at one time
  EXPECT_EQ(events.take({0, 2, 2.0, 1}), (Event{0, 2, 2.0, true}));
}

TEST(EventCheckTest, TakesZeroForNegativePolarity) {
  EventCheck events = check();
  EXPECT_FALSE(events.take({0, 0, 1.5, 0}).positive);
  EXPECT_TRUE(events.take({0, 0, 1.5, 1}).positive);
}

TEST(EventCheckTest, RefusesMixedPolarities) {
  EventCheck events = check();
  events.take({0, 0, 1.5, 0});
  EXPECT_THAT(
      [&] {
        events.take({0, 0, 1.5, -1});
      },
      ThrowsMessage<EventFault>(HasSubstr("got -1 after 0")));
}

TEST(EventCheckTest, RefusesOtherPolarities) {
  for (const double polarity : {2.0, -2.0, 0.5, kNan, kInfinity}) {
    EXPECT_THAT(
        [&] {
          check().take({0, 0, 1.5, polarity});
        },
        ThrowsMessage<EventFault>(HasSubstr("expected polarities")));
  }
}

TEST(EventCheckTest, RefusesPixelsOutsideTheImage) {
  for (const double x : {-1.0, 4.0, 0.5, 1e300, kNan, kInfinity, -kInfinity}) {
    EXPECT_THAT(
        [&] {
          check().take({x, 0, 1.5, 1});
        },
        ThrowsMessage<EventFault>(HasSubstr("expected a pixel of an image of 4x3")));
  }
  EXPECT_THAT(
      [&] {
        check().take({0, 3, 1.5, 1});
      },
      ThrowsMessage<EventFault>(HasSubstr("got x = 0, y = 3")));
}

TEST(EventCheckTest, RefusesTimesOutsideTheStretch) {
  EXPECT_THAT(
      [&] {
        check().take({0, 0, 1.0, 1});
      },
      ThrowsMessage<EventFault>(HasSubstr("expected a time after 1 s, got the same")));
  EXPECT_THAT(
      [&] {
        check().take({0, 0, 2.5, 1});
      },
      ThrowsMessage<EventFault>(HasSubstr("got 2.5 s before an event at or before 2 s")));
  for (const double time_s : {kNan, kInfinity, -kInfinity}) {
    EXPECT_THAT(
        [&] {
          check().take({0, 0, time_s, 1});
        },
        ThrowsMessage<EventFault>(HasSubstr("expected a finite time")));
  }
}

TEST(EventCheckTest, RefusesTimesThatFall) {
  EventCheck events = check();
  events.take({0, 0, 1.75, 1});
  EXPECT_THAT(
      [&] {
        events.take({0, 0, 1.5, 1});
      },
      ThrowsMessage<EventFault>(HasSubstr("got 1.5 s after 1.75 s")));
}

}  // namespace
}  // namespace eventgan
