#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "stages/recordings/event_check_internal.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Pictures of 4x3 (width x height), events in (1, 2].
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

TEST(EventCheckTest, RefusesPixelsOutsideThePicture) {
  for (const double x : {-1.0, 4.0, 0.5, 1e300, kNan, kInfinity, -kInfinity}) {
    EXPECT_THAT(
        [&] {
          check().take({x, 0, 1.5, 1});
        },
        ThrowsMessage<EventFault>(HasSubstr("expected a pixel of a picture of 4x3")));
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
