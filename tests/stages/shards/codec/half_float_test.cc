#include "stages/shards/codec/half_float.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

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

/// Whatever the processor converts with must round as to_half does: every half, the middles between
/// them, their neighbours, and numbers of all magnitudes.
TEST(HalfFloat, ManyAtOnceAreTheSameBits) {
  std::vector<float> values;
  for (std::uint16_t half = 0; half < 0x7bff; ++half) {
    const float low = from_half(half);
    const float middle = low + (from_half(half + 1) - low) / 2;
    for (const float value :
         {low, middle, std::nextafter(middle, 0.0f), std::nextafter(middle, 1e9f)}) {
      values.push_back(value);
    }
  }
  std::mt19937 random(8);
  for (int i = 0; i < 100000; ++i) {
    values.push_back(std::bit_cast<float>(static_cast<std::uint32_t>(random() % 0x7f800000u)));
  }
  values.insert(values.end(), {-0.0f, std::numeric_limits<float>::max(), kLargestHalf, 65520.0f});
  std::vector<std::uint16_t> halves(values.size());
  to_halves(values, halves.data());
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_EQ(halves[i], to_half(std::min(values[i], kLargestHalf))) << values[i];
  }
}

TEST(HalfFloat, AnyNumberAtOnceAndNothingBehindThem) {
  for (std::size_t count = 0; count < 40; ++count) {
    const std::vector<float> values(count, 2.0f);
    std::vector<std::uint16_t> halves(count + 1, 7);
    to_halves(values, halves.data());
    for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(halves[i], 0x4000);
    ASSERT_EQ(halves[count], 7);
  }
}

}  // namespace
}  // namespace eventgan
