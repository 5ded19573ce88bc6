#include "stages/frames/decoding/prepared_frame.h"

#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>

#include "tests/stages/frames/decoding/test_pictures.h"

namespace eventgan {
namespace {

ColourView view_of(const cv::Mat& picture) { return {{picture.rows, picture.cols}, picture.data}; }

TEST(PreparedFrame, EveryLevelBecomesTheSameFloatAsItsEquation) {
  std::vector<std::uint8_t> levels(256);
  std::iota(levels.begin(), levels.end(), std::uint8_t{0});
  std::vector<float> input(256);
  to_input(levels, input);
  for (int u = 0; u < 256; ++u) {
    const volatile float level = static_cast<float>(u);  // computed here and now
    EXPECT_EQ(input[u], (level / 255.0f - 0.5f) * 2.0f) << u;
  }
  EXPECT_EQ(input[0], -1.0f);
  EXPECT_EQ(input[255], 1.0f);
}

TEST(PreparedFrame, KeepsOnlyTheVisiblePartAndTheSizeItCameFrom) {
  // 4x8 into 4x4: two columns are cut on either side.
  cv::Mat picture(4, 8, CV_8UC3);
  for (int x = 0; x < 8; ++x) picture.col(x).setTo(cv::Scalar::all(10 * x));
  ImageSpec spec;
  spec.size = ImageSize{4, 4};
  spec.fit = ImageFit::kCrop;
  const PreparedFrame frame = prepare_frame(view_of(picture), spec);
  EXPECT_EQ(frame.placement.source, (ImageSize{4, 8}));
  std::vector<std::uint8_t> expected;
  for (int y = 0; y < 4; ++y) expected.insert(expected.end(), {20, 30, 40, 50});
  EXPECT_EQ(frame.grey, expected);
}

TEST(PreparedFrame, AnotherSpecPreparesTheSameFrameOtherwise) {
  const cv::Mat picture = testing::gradient_picture({20, 30});
  ImageSpec spec;
  spec.size = ImageSize{16, 16};
  const auto plain = prepare_frame(view_of(picture), spec).grey;
  spec.blur = 3;
  const auto blurred = prepare_frame(view_of(picture), spec).grey;
  spec.size = ImageSize{17, 16};
  EXPECT_NE(plain, blurred);
  EXPECT_EQ(prepare_frame(view_of(picture), spec).grey.size(), 16u * 17);
}

TEST(PreparedFrame, WhatCannotBePlacedIsRefused) {
  // Cropped, 1 x 2^26 pixels would have to grow to 64 x 2^32.
  ImageSpec spec;
  spec.size = ImageSize{64, 64};
  spec.fit = ImageFit::kCrop;
  EXPECT_THROW(prepare_frame({{1, 1 << 26}, nullptr}, spec), std::runtime_error);
}

}  // namespace
}  // namespace eventgan
