#include "stages/events/normalization.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <numeric>
#include <vector>

#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"

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

TEST(Normalize, ClipsAndDividesAndLeavesAnEmptyVolumeAlone) {
  std::vector<float> volume{0, 1, 2, 8};
  normalize(volume, 4.0f);
  EXPECT_THAT(volume, ::testing::ElementsAre(0, 0.25f, 0.5f, 1));
  std::vector<float> empty(5, 0.0f);
  normalize(empty, 0.0f);
  EXPECT_THAT(empty, ::testing::Each(0.0f));
}

TEST(Normalize, OfTheSmallestNumbersIsFinite) {
  std::vector<float> volume(4, std::numeric_limits<float>::denorm_min());
  normalize(volume, eta98(volume));
  EXPECT_THAT(volume, ::testing::Each(1.0f));
}

TEST(Normalize, EqualsThePublishedCode) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  for (const std::string& name : testing::member_names(golden, "events")) {
    auto volume = testing::read_array(golden, "events/" + name + "/volume").values;
    const auto expected = testing::read_array(golden, "events/" + name + "/normalized").values;
    normalize(volume, eta98(volume));
    EXPECT_THAT(volume, ::testing::Pointwise(::testing::FloatNear(1e-6f), expected)) << name;
  }
}

TEST(VolumeStatistics, CountsEachPolarity) {
  // 1 bin, 2x2: positive 1 + 3, negative 0.5; 3 of 8 values are not zero.
  const std::vector<float> volume{1, 0, 3, 0, 0, 0.5f, 0, 0};
  const VolumeStatistics statistics = volume_statistics(volume, {1, {2, 2}});
  EXPECT_DOUBLE_EQ(statistics.sum_positive, 4.0);
  EXPECT_DOUBLE_EQ(statistics.sum_negative, 0.5);
  EXPECT_FLOAT_EQ(statistics.max, 3.0f);
  EXPECT_FLOAT_EQ(statistics.nonzero_fraction, 0.375f);
  EXPECT_FLOAT_EQ(statistics.eta98, 1.0f);  // k = int(2.94) = 2 of {0.5, 1, 3}
  EXPECT_EQ(statistics.flags, 0u);
}

TEST(VolumeStatistics, FlagsAnEmptyVolume) {
  const std::vector<float> volume(8, 0.0f);
  const VolumeStatistics statistics = volume_statistics(volume, {1, {2, 2}});
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

TEST(Normalized, DividesByTheVolumesOwnEta98) {
  // Two values that are not zero: k = max(int(1.96), 1) = 1, the lower one.
  EXPECT_EQ(normalized({0, 2, 8, 0}), (std::vector<float>{0, 1, 1, 0}));
  EXPECT_EQ(normalized({0, 0}), (std::vector<float>{0, 0}));
}

}  // namespace
}  // namespace eventgan
