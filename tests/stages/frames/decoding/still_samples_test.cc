#include "stages/frames/decoding/detail/still_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/frames.h"

namespace eventgan {
namespace {

/// Places in 1/1024 px of samples along a row, and the share of each one's second column.
struct Samples {
  std::vector<int> x, y;
  std::vector<std::int32_t> shares_x;
  int row_x = 0, row_y = 0;
  std::int32_t shares_y = 0;

  SampledPlaces places() const { return {x, y, shares_x, row_x, row_y, shares_y}; }
};

constexpr std::int32_t shares_of(int second) { return (second << 16) + kSampleShare - second; }

cv::Mat random_plane(ImageSize size, const CounterRandom& random) {
  cv::Mat plane(size.height, size.width, CV_16SC1);
  for (int i = 0; i < size.height * size.width; ++i) {
    plane.ptr<std::int16_t>()[i] = static_cast<std::int16_t>(kPlaneLevel * random.below(i, 256));
  }
  return plane;
}

TEST(StillSamples, AreTheSameWithAllInstructions) {
  const CounterRandom random = CounterRandom(5).keyed("samples");
  std::uint64_t draw = 0;
  const auto between = [&](int low, int high) {
    return low + static_cast<int>(random.below(draw++, static_cast<std::uint64_t>(high - low + 1)));
  };
  for (const ImageSize size : {ImageSize{1, 1}, {1, 7}, {9, 2}, {40, 53}}) {
    const SampledPlane plane(random_plane(size, random));
    for (const std::size_t count : {0, 1, 2, 63, 64, 65, 131}) {
      Samples row;
      const int far = between(0, 3) == 0 ? 1'000'000'000 : 5000;  // one row in four
      row.row_x = between(-far, far);
      row.row_y = between(-far, 1024 * size.height + far);
      row.shares_y = shares_of(between(0, kSampleShare));
      for (std::size_t i = 0; i < count; ++i) {
        row.x.push_back(between(-9000, 1024 * size.width + 9000));
        row.y.push_back(between(-2000, 2000));
        row.shares_x.push_back(shares_of(between(0, kSampleShare)));
      }
      for (const SampleKernel* kernel : {&kCubicSamples, &kLinearSamples}) {
        std::vector<std::int16_t> found(count), expected(count);
        sample_row(plane, *kernel, row.places(), found);
        sample_row_anywhere(plane, *kernel, row.places(), expected);
        EXPECT_EQ(found, expected) << count;
      }
    }
  }
}

TEST(StillSamples, AreThePlaneWhereNothingIsBetween) {
  const cv::Mat values = random_plane({6, 80}, CounterRandom(6));
  const SampledPlane plane(values);
  Samples row;
  row.row_y = 2 * 1024;
  row.shares_y = shares_of(0);
  for (int x = -3; x < 83; ++x) {
    row.x.push_back(1024 * x);
    row.y.push_back(0);
    row.shares_x.push_back(shares_of(0));
  }
  for (const SampleKernel* kernel : {&kCubicSamples, &kLinearSamples}) {
    std::vector<std::int16_t> found(row.x.size());
    sample_row(plane, *kernel, row.places(), found);
    for (int x = -3; x < 83; ++x) {
      const int nearest = std::clamp(x, 0, 79);
      // What rounding down takes on average is added to all: 3/32 of a level.
      ASSERT_EQ(found[static_cast<std::size_t>(x + 3)],
                std::min(values.at<std::int16_t>(2, nearest) / 4 + 3, kRowWhite));
    }
  }
}

TEST(StillSamples, OfARampLieOnItAndAreJoinedByTheirShares) {
  cv::Mat values(20, 60, CV_16SC1);  // 3 levels a column, 2 a row
  for (int y = 0; y < values.rows; ++y) {
    for (int x = 0; x < values.cols; ++x) {
      values.at<std::int16_t>(y, x) = static_cast<std::int16_t>(kPlaneLevel * (3 * x + 2 * y));
    }
  }
  const SampledPlane plane(values);
  Samples row;
  row.row_x = 512;
  row.row_y = 7 * 1024 + 256;
  row.shares_y = shares_of(kSampleShare / 2);
  for (int i = 0; i < 40; ++i) {
    row.x.push_back(1024 * (2 + i) + 32 * (i % 32));
    row.y.push_back(32 * (i % 7));
    row.shares_x.push_back(shares_of(64 * (i % 32)));
  }
  for (const SampleKernel* kernel : {&kCubicSamples, &kLinearSamples}) {
    std::vector<std::int16_t> found(row.x.size());
    sample_row(plane, *kernel, row.places(), found);
    for (int i = 0; i < 40; ++i) {
      const double x = (row.row_x + row.x[i]) / 1024.0 + (i % 32) / 32.0;
      const double y = (row.row_y + row.y[i]) / 1024.0 + 0.5;
      // A quarter of a level: products are rounded down, and 3/32 are added.
      ASSERT_NEAR(found[i], kRowLevel * (3 * x + 2 * y), kRowLevel / 4) << i;
    }
  }
}

}  // namespace
}  // namespace eventgan
