#include "stages/events/volume_statistics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

constexpr float kDenormal = std::numeric_limits<float>::denorm_min();
constexpr float kLargest = std::numeric_limits<float>::max();

/// Around a row of 16, a block of 256 and several blocks.
constexpr std::size_t kSizes[] = {1, 2, 15, 16, 17, 255, 256, 257, 1000, 5000};

/// Sorted, largest first, without zeros.
std::vector<float> sorted_nonzero(std::vector<float> values) {
  std::erase(values, 0.0f);
  std::sort(values.begin(), values.end(), std::greater<>());
  return values;
}

void expect_every_kth(const std::vector<float>& values) {
  const std::vector<float> sorted = sorted_nonzero(values);
  // Split in two unequal parts, as a volume is split by polarity.
  const std::span<const float> all(values);
  const std::size_t third = values.size() / 3;
  const std::array scans{scan_values(all.first(third)), scan_values(all.subspan(third))};
  ASSERT_EQ(scans[0].nonzero + scans[1].nonzero, sorted.size());
  const std::size_t step = std::max<std::size_t>(sorted.size() / 25, 1);
  for (std::size_t k = 1; k <= sorted.size(); k += step) {
    ASSERT_EQ(kth_largest(scans, k), sorted[k - 1]) << k << " of " << sorted.size();
  }
  if (!sorted.empty()) {
    EXPECT_EQ(kth_largest(scans, sorted.size()), sorted.back());
  }
}

TEST(KthLargest, IsTheOneThatSortingFinds) {
  std::mt19937 random(4);
  std::exponential_distribution<float> small(3);
  for (const std::size_t size : kSizes) {
    std::vector<float> sparse(size), dense(size), ramp(size), any(size);
    for (std::size_t i = 0; i < size; ++i) {
      dense[i] = small(random);
      sparse[i] = random() % 11 == 0 ? dense[i] : 0.0f;
      ramp[i] = static_cast<float>(i);  // all the largest next to each other
      any[i] = std::ldexp(1.0f + static_cast<float>(random() % 8),
                          static_cast<int>(random() % 270) - 149);
    }
    for (const auto& values : {sparse, dense, ramp, any}) expect_every_kth(values);
  }
}

TEST(KthLargest, TellsNeighboursEqualAndExtremeNumbersApart) {
  // Numbers that share the upper half of their bits, one bit apart.
  std::vector<float> values{1.0f};
  while (values.size() < 700) values.push_back(std::nextafter(values.back(), 2.0f));
  expect_every_kth(values);
  expect_every_kth(std::vector<float>(1000, 0.25f));
  expect_every_kth(std::vector<float>(300, kDenormal));
  expect_every_kth({0, kDenormal, 0, kLargest, -0.0f, std::numeric_limits<float>::min()});
}

TEST(ScanValues, CountsAddsAndFindsTheLargest) {
  for (const std::size_t size : kSizes) {
    std::mt19937 random(static_cast<unsigned>(size));
    std::vector<float> values(size);
    for (float& value : values) value = static_cast<float>(random() % 5) / 4;
    const ValueScan scan = scan_values(values);
    EXPECT_TRUE(scan.sound);
    EXPECT_EQ(scan.nonzero, sorted_nonzero(values).size());
    EXPECT_EQ(scan.max, *std::max_element(values.begin(), values.end()));
    double sum = 0;  // of quarters: exact
    for (const float value : values) sum += value;
    EXPECT_EQ(scan.sum, sum);
  }
}

TEST(ScanValues, AddsInTheOrderItStatesWithoutLoss) {
  std::mt19937 random(9);
  std::vector<float> values(1003);
  for (float& value : values) value = std::ldexp(1.0f, static_cast<int>(random() % 100) - 50);
  double partial[16] = {};
  for (std::size_t i = 0; i < values.size(); ++i) partial[i % 16] += values[i];
  double sum = 0;
  for (const double part : partial) sum += part;
  EXPECT_EQ(scan_values(values).sum, sum);
  // In float32 a sum near 1e6 moves in steps of 0.06, so that adding 0.1 is wrong by a tenth.
  values = std::vector<float>(10'000'000, 0.1f);
  EXPECT_NEAR(scan_values(values).sum, 1e7 * double(0.1f), 1e-5);
}

TEST(ScanValues, OfNothing) {
  for (const std::vector<float>& values : {std::vector<float>{}, std::vector<float>(300, -0.0f)}) {
    const ValueScan scan = scan_values(values);
    EXPECT_TRUE(scan.sound);
    EXPECT_EQ(scan.nonzero, 0u);
    EXPECT_EQ(scan.sum, 0.0);
    EXPECT_EQ(scan.max, 0.0f);
  }
}

TEST(ScanValues, SeesOneUnsoundValueAnywhere) {
  const float bad_values[] = {std::nanf(""),
                              -std::nanf(""),
                              std::numeric_limits<float>::infinity(),
                              -std::numeric_limits<float>::infinity(),
                              -kDenormal,
                              -kLargest};
  for (const std::size_t size : {1u, 16u, 257u, 520u}) {
    std::vector<float> values(size, 0.5f);
    for (std::size_t at = 0; at < size; ++at) {
      for (const float bad : bad_values) {
        values[at] = bad;
        ASSERT_FALSE(scan_values(values).sound) << bad << " at " << at;
      }
      values[at] = 0.5f;
    }
  }
  // Among the largest numbers there are, which a sum of floats would not survive.
  std::vector<float> large(1000, kLargest);
  EXPECT_TRUE(scan_values(large).sound);
  large[3] = std::numeric_limits<float>::infinity();
  large[4] = -std::numeric_limits<float>::infinity();
  EXPECT_FALSE(scan_values(large).sound);
}

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

TEST(Eta98, OfTwoValuesIsTheSmaller) {
  EXPECT_EQ(eta98(std::vector<float>{0, 2, 0, 1}), 1.0f);  // k = int(1.96) = 1
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
  EXPECT_THROWS(eta98(std::vector<float>{1, std::nanf("")}), std::invalid_argument,
                "expected finite values >= 0, got others");
  EXPECT_THROWS(eta98(std::vector<float>{1, -1}), std::invalid_argument,
                "expected finite values >= 0, got others");
}

TEST(VolumeStatistics, AroundThePartThatIsGivenAllIsZero) {
  // 1 bin, 1x2 of a volume of 2x4: 3 of 16 values are not zero.
  const VolumeStatistics statistics =
      volume_statistics(std::vector<float>{1, 2, 0, 4}, {1, {2, 4}}).value();
  EXPECT_EQ(statistics.nonzero_fraction, 0.1875f);
  EXPECT_EQ(statistics.sum_positive, 3.0);
  EXPECT_EQ(statistics.sum_negative, 4.0);
  EXPECT_EQ(statistics.eta98, 2.0f);
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

TEST(Normalize, ClipsAndDividesTheSmallestNumbersToo) {
  std::vector<float> volume{0, 1, 2, 8};
  normalize(volume, 4.0f);
  EXPECT_THAT(volume, ::testing::ElementsAre(0, 0.25f, 0.5f, 1));
  std::vector<float> empty(5, 0.0f);
  normalize(empty, 0.0f);
  EXPECT_THAT(empty, ::testing::Each(0.0f));
  volume = std::vector<float>(4, std::numeric_limits<float>::denorm_min());
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

TEST(Normalized, DividesByTheVolumesOwnEta98) {
  // Two values that are not zero: k = max(int(1.96), 1) = 1, the lower one.
  EXPECT_EQ(normalized({0, 2, 8, 0}), (std::vector<float>{0, 1, 1, 0}));
  EXPECT_EQ(normalized({0, 0}), (std::vector<float>{0, 0}));
}

}  // namespace
}  // namespace eventgan
