#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "manifests/faults.h"
#include "stages/recordings/frame_times_internal.h"

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

}  // namespace
}  // namespace eventgan
