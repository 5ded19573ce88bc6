#include "stages/events/volume_statistics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace eventgan {
namespace {

TEST(Eta98, IsTheKthSmallestOfTheNonZeroValues) {
  // 100 non-zero values 1..100 among zeros: k = int(0.98 * 100) = 98, the 98th smallest is 98.
  std::vector<float> volume(150, 0.0f);
  std::iota(volume.begin() + 50, volume.end(), 1.0f);
  EXPECT_EQ(eta98(volume), 98.0f);
}

TEST(Eta98, OfOneValueIsThatValue) {
  const std::vector<float> volume{0, 0.25f, 0};  // int(0.98) = 0, raised to 1
  EXPECT_EQ(eta98(volume), 0.25f);
}

TEST(Eta98, OfNoValuesIsZero) {
  EXPECT_EQ(eta98({}), 0.0f);
  EXPECT_EQ(eta98(std::vector<float>(18, 0.0f)), 0.0f);
}

TEST(VolumeStatistics, CountsEachPolarity) {
  // 1 bin, 2x2: positive 1 + 3, negative 0.5; 3 of 8 values are not zero.
  const std::vector<float> volume{1, 0, 3, 0, 0, 0.5f, 0, 0};
  const VolumeStatistics statistics = volume_statistics(volume, {1, {2, 2}}).value();
  EXPECT_DOUBLE_EQ(statistics.sum_positive, 4.0);
  EXPECT_DOUBLE_EQ(statistics.sum_negative, 0.5);
  EXPECT_FLOAT_EQ(statistics.max, 3.0f);
  EXPECT_FLOAT_EQ(statistics.nonzero_fraction, 0.375f);
  EXPECT_FLOAT_EQ(statistics.eta98, 1.0f);  // k = int(2.94) = 2 of {0.5, 1, 3}
  EXPECT_EQ(statistics.flags, 0u);
}

TEST(VolumeStatistics, FlagsAnEmptyVolume) {
  const std::vector<float> volume(8, 0.0f);
  const VolumeStatistics statistics = volume_statistics(volume, {1, {2, 2}}).value();
  EXPECT_EQ(statistics.flags, kFlagEmpty);
  EXPECT_EQ(statistics.eta98, 0.0f);
}

TEST(FirstUnsoundValue, FindsNanInfinityAndNegativeValues) {
  const std::vector<float> sound{0.0f, 1.0f, std::numeric_limits<float>::max()};
  EXPECT_EQ(first_unsound_value(sound), sound.size());
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1e-30f}) {
    const std::vector<float> volume{0.0f, bad, 1.0f};
    EXPECT_EQ(first_unsound_value(volume), 1u) << bad;
  }
}

TEST(Eta98, EqualsItsDefinitionForAnyNumberOfValues) {
  std::mt19937 random(2);
  std::gamma_distribution<float> draw(0.5f, 0.3f);
  for (std::size_t size = 1; size < 3000; size += 1 + size / 7) {
    std::vector<float> volume(size);
    for (float& value : volume) value = random() % 3 == 0 ? draw(random) : 0.0f;
    volume[0] = 0.5f;
    std::vector<float> nonzero = volume;
    std::erase(nonzero, 0.0f);
    std::sort(nonzero.begin(), nonzero.end());
    const auto k = std::max<std::size_t>(std::size_t(0.98 * double(nonzero.size())), 1);
    ASSERT_EQ(eta98(volume), nonzero[k - 1]) << size;
  }
}

TEST(Eta98, OfEqualDenormalAndLargestNumbers) {
  EXPECT_EQ(eta98(std::vector<float>(4000, 0.3f)), 0.3f);
  const float denormal = std::numeric_limits<float>::denorm_min();
  EXPECT_EQ(eta98(std::vector<float>{0, denormal, -0.0f}), denormal);
  EXPECT_EQ(eta98(std::vector<float>(99, std::numeric_limits<float>::max())),
            std::numeric_limits<float>::max());
}

TEST(Eta98, RefusesWhatNoVolumeHolds) {
  EXPECT_THROW(eta98(std::vector<float>{1, std::nanf("")}), std::invalid_argument);
  EXPECT_THROW(eta98(std::vector<float>{1, -1}), std::invalid_argument);
}

TEST(VolumeStatistics, AroundThePartThatIsGivenAllIsZero) {
  // 1 bin, 1x2 of a volume of 2x4: 3 of 16 values are not zero.
  const VolumeStatistics statistics =
      volume_statistics(std::vector<float>{1, 2, 0, 4}, {1, {2, 4}}).value();
  EXPECT_EQ(statistics.nonzero_fraction, 0.1875f);
  EXPECT_EQ(statistics.sum_positive, 3.0);
  EXPECT_EQ(statistics.sum_negative, 4.0);
  EXPECT_EQ(statistics.eta98, 2.0f);
}

TEST(VolumeStatistics, OfNoValuesAtAll) {
  EXPECT_EQ(volume_statistics({}, {1, {2, 2}}).value().flags, kFlagEmpty);
  EXPECT_EQ(volume_statistics({}, {1, {0, 0}}).value().nonzero_fraction, 0.0f);
}

TEST(VolumeStatistics, ThereAreNoneOfAnUnsoundVolume) {
  for (const std::size_t at : {0u, 3u, 4u, 7u}) {
    std::vector<float> volume(8, 1.0f);
    volume[at] = std::nanf("");
    EXPECT_FALSE(volume_statistics(volume, {1, {2, 2}}).has_value());
    EXPECT_EQ(first_unsound_value(volume), at);
  }
}

}  // namespace
}  // namespace eventgan
