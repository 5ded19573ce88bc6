#include "stages/frames/decoding/prepared_frame.h"

#include <gtest/gtest.h>

#include <numeric>
#include <stdexcept>

#include "tests/stages/base/images/test_images.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

ColourFrame plain_frame(ImageSize size, std::uint8_t value) {
  return {size, std::vector<std::uint8_t>(3 * size.pixel_count(), value)};
}

TEST(PlacedImage, BordersAreBlack) {
  // 2x2 enlarged to 4x4 in the middle of 4x8.
  const Placement placement{{2, 2}, {4, 4}, {4, 8}, /*offset_x=*/2, /*offset_y=*/0};
  const auto placed = place_colour(plain_frame({2, 2}, 200), placement);
  ASSERT_EQ(placed.size(), 3u * 4 * 8);
  for (int x = 0; x < 8; ++x) {
    EXPECT_EQ(placed[3 * (8 * 3 + x)], x >= 2 && x < 6 ? 200 : 0) << "column " << x;
  }
}

TEST(PlacedImage, CropKeepsTheMiddle) {
  ColourFrame frame = plain_frame({1, 4}, 0);
  for (int x = 0; x < 4; ++x) frame.bgr[3 * x + 1] = static_cast<std::uint8_t>(10 * x);
  const Placement placement{{1, 4}, {1, 4}, {1, 2}, /*offset_x=*/-1, /*offset_y=*/0};
  EXPECT_EQ(place_colour(frame, placement), (std::vector<std::uint8_t>{0, 10, 0, 0, 20, 0}));
}

TEST(PlacedImage, RefusesAFrameOfAnotherSize) {
  const Placement placement{{2, 2}, {2, 2}, {2, 2}, 0, 0};
  EXPECT_THROWS(place_colour(plain_frame({2, 3}, 0), placement), std::invalid_argument,
                "expected a frame of the placement's source size, got another");
}

TEST(VisiblePart, StretchIsTheWholeVolume) {
  const VisiblePart part = visible_part({{10, 20}, {5, 7}, {5, 7}, 0, 0});
  EXPECT_EQ(part.size, (ImageSize{5, 7}));
  EXPECT_EQ(part.volume_x + part.volume_y + part.scaled_x + part.scaled_y, 0);
}

TEST(VisiblePart, LetterboxIsTheWholeImage) {
  const VisiblePart part = visible_part({{10, 20}, {5, 10}, {9, 10}, 0, 2});
  EXPECT_EQ(part.size, (ImageSize{5, 10}));
  EXPECT_EQ(part.volume_y, 2);
  EXPECT_EQ(part.scaled_y, 0);
}

TEST(VisiblePart, CropIsTheWholeVolumeCutFromTheMiddle) {
  // floor((5 - 10) / 2) = -3: three columns are cut on the left, two on the right.
  const VisiblePart part = visible_part({{10, 20}, {5, 10}, {5, 5}, -3, 0});
  EXPECT_EQ(part.size, (ImageSize{5, 5}));
  EXPECT_EQ(part.scaled_x, 3);
  EXPECT_EQ(part.volume_x, 0);
}

ColourView view_of(const cv::Mat& image) { return {{image.rows, image.cols}, image.data}; }

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
  cv::Mat image(4, 8, CV_8UC3);
  for (int x = 0; x < 8; ++x) image.col(x).setTo(cv::Scalar::all(10 * x));
  ImageSpec spec;
  spec.size = ImageSize{4, 4};
  spec.fit = ImageFit::kCrop;
  const PreparedFrame frame = prepare_frame(view_of(image), spec);
  EXPECT_EQ(frame.placement.source, (ImageSize{4, 8}));
  std::vector<std::uint8_t> expected;
  for (int y = 0; y < 4; ++y) expected.insert(expected.end(), {20, 30, 40, 50});
  EXPECT_EQ(frame.grey, expected);
}

TEST(PreparedFrame, AnotherSpecPreparesTheSameFrameOtherwise) {
  const cv::Mat image = testing::gradient_image({20, 30});
  ImageSpec spec;
  spec.size = ImageSize{16, 16};
  const auto plain = prepare_frame(view_of(image), spec).grey;
  spec.blur = 3;
  const auto blurred = prepare_frame(view_of(image), spec).grey;
  spec.size = ImageSize{17, 16};
  EXPECT_NE(plain, blurred);
  EXPECT_EQ(prepare_frame(view_of(image), spec).grey.size(), 16u * 17);
}

/// Random levels, [y, x, channel].
std::vector<std::uint8_t> random_levels(ImageSize size, int channels) {
  cv::Mat image(size.height, size.width, CV_8UC(channels));
  cv::RNG(7).fill(image, cv::RNG::UNIFORM, 0, 256);
  return {image.datastart, image.dataend};
}

TEST(PreparedFrame, GreyIsWhatThreeEqualChannelsGive) {
  constexpr ImageSize kSides{37, 53};
  const std::vector<std::uint8_t> grey = random_levels(kSides, 1);
  std::vector<std::uint8_t> colour;
  for (const std::uint8_t level : grey) colour.insert(colour.end(), 3, level);
  for (const auto order : {GreyOrder::kBeforeResize, GreyOrder::kAfterResize}) {
    ImageSpec spec;
    spec.size = ImageSize{24, 40};
    spec.grey = order;
    spec.blur = 5;
    EXPECT_EQ(prepare_frame({kSides, grey.data(), ImageView::Channels::kGrey}, spec).grey,
              prepare_frame({kSides, colour.data()}, spec).grey);
  }
}

TEST(PreparedFrame, TheOrderOfChannelsChangesNothingButTheirOrder) {
  constexpr ImageSize kSides{19, 30};
  const std::vector<std::uint8_t> bgr = random_levels(kSides, 3);
  std::vector<std::uint8_t> rgb = bgr;
  for (std::size_t i = 0; i < rgb.size(); i += 3) std::swap(rgb[i], rgb[i + 2]);
  for (const auto order : {GreyOrder::kBeforeResize, GreyOrder::kAfterResize}) {
    ImageSpec spec;
    spec.size = ImageSize{25, 16};
    spec.grey = order;
    EXPECT_EQ(prepare_frame({kSides, rgb.data(), ImageView::Channels::kRgb}, spec).grey,
              prepare_frame({kSides, bgr.data()}, spec).grey);
  }
}

TEST(PreparedFrame, WhatCannotBePlacedIsRefused) {
  // Cropped, 1 x 2^26 pixels would have to grow to 64 x 2^32.
  ImageSpec spec;
  spec.size = ImageSize{64, 64};
  spec.fit = ImageFit::kCrop;
  EXPECT_THROWS(prepare_frame({{1, 1 << 26}, nullptr}, spec), std::runtime_error,
                "expected a scaled image of at most 2147483647 pixels a side, got 4294967296");
}

}  // namespace
}  // namespace eventgan
