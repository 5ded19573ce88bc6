#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/recordings/frame_range_internal.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

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

}  // namespace
}  // namespace eventgan
