#include "stages/shards/half_float.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace eventgan {
namespace {

TEST(HalfFloat, HasTheTextbookValues) {
  EXPECT_EQ(from_half(0x0000), 0.0f);
  EXPECT_EQ(from_half(0x3c00), 1.0f);
  EXPECT_EQ(from_half(0xc000), -2.0f);
  EXPECT_EQ(from_half(0x3555), 0.333251953125f);
  EXPECT_EQ(from_half(0x7bff), kLargestHalf);
  EXPECT_EQ(from_half(0x0400), 0x1p-14f);
  EXPECT_EQ(from_half(0x0001), 0x1p-24f);
  EXPECT_EQ(from_half(0x7c00), std::numeric_limits<float>::infinity());
  EXPECT_TRUE(std::isnan(from_half(0x7e00)));
}

TEST(HalfFloat, EveryHalfSurvives) {
  for (std::uint16_t half = 0; half <= 0x7bff; ++half) {
    ASSERT_EQ(to_half(from_half(half)), half) << half;
  }
}

TEST(HalfFloat, RoundsToTheNearestTiesToEven) {
  // Between every two neighbours: the middle goes to the even one, what is next to the middle to
  // its side.
  for (std::uint16_t half = 0; half < 0x7bff; ++half) {
    const float low = from_half(half);
    const float high = from_half(half + 1);
    const float middle = low + (high - low) / 2;  // exact: float has 13 more bits
    const std::uint16_t even = half % 2 == 0 ? half : half + 1;
    ASSERT_EQ(to_half(middle), even) << middle;
    ASSERT_EQ(to_half(std::nextafter(middle, low)), half) << middle;
    ASSERT_EQ(to_half(std::nextafter(middle, high)), half + 1) << middle;
  }
}

TEST(HalfFloat, SmallestNumbersBecomeZero) {
  EXPECT_EQ(to_half(std::numeric_limits<float>::denorm_min()), 0);
  EXPECT_EQ(to_half(0x1p-25f), 0);  // tie
  EXPECT_EQ(to_half(-0.0f), 0);
}

}  // namespace
}  // namespace eventgan
