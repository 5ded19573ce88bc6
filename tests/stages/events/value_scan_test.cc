#include "stages/events/value_scan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

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

TEST(KthLargest, TellsNeighboursApart) {
  // Numbers that share the upper half of their bits, one bit apart.
  std::vector<float> values{1.0f};
  while (values.size() < 700) values.push_back(std::nextafter(values.back(), 2.0f));
  expect_every_kth(values);
}

TEST(KthLargest, OfEqualAndOfExtremeNumbers) {
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

TEST(ScanValues, AddsInTheOrderItStates) {
  std::mt19937 random(9);
  std::vector<float> values(1003);
  for (float& value : values) value = std::ldexp(1.0f, static_cast<int>(random() % 100) - 50);
  double partial[16] = {};
  for (std::size_t i = 0; i < values.size(); ++i) partial[i % 16] += values[i];
  double sum = 0;
  for (const double part : partial) sum += part;
  EXPECT_EQ(scan_values(values).sum, sum);
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

}  // namespace
}  // namespace eventgan
