#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <vector>

#include "stages/events/images/comparison_image.h"
#include "stages/events/images/detail/time_panel.h"
#include "stages/events/images/preview_image.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

TEST(PreviewLayout, IsAsLargeAsAPageHasRoomFor) {
  const auto expect = [](ImageSize volume, int factor, int columns) {
    const PreviewLayout layout = preview_layout(volume);
    EXPECT_EQ(layout.scale.factor, factor) << volume.height << "x" << volume.width;
    EXPECT_EQ(layout.columns, columns) << volume.height << "x" << volume.width;
  };
  expect({260, 861}, 1, 1);  // 2 x 861 is beyond 1420
  expect({375, 1242}, 1, 1);
  expect({260, 346}, 2, 2);  // 2 x 692 + 3 x 6 = 1402
  expect({240, 320}, 2, 2);
  expect({128, 128}, 5, 2);    // 640 twice each way; in a row 4 x 256
  expect({1, 1}, 8, 4);        // no larger, and then the fewest rows
  expect({4000, 4000}, 1, 1);  // too large for any page
}

TEST(PanelScale, APixelsCentreStaysInTheMiddleOfItsSquare) {
  const PanelScale scale{4};
  // Volume pixel 3 becomes panel pixels 12..15, with the middle 13.5.
  EXPECT_EQ(scale.point({3, 0}), (Point{13.5, 1.5}));
  // The edge at 3 lies before panel pixel 12.
  EXPECT_EQ(scale.corner(3, 0), (Point{11.5, -0.5}));
}

constexpr VolumeShape kPixel{9, {1, 1}};

/// The panel's one pixel for a volume of one pixel with `value` in one channel.
cv::Vec3b pixel_of(int channel, float value) {
  std::vector<float> volume(kPixel.value_count(), 0.0f);
  volume[channel] = value;
  return time_panel(volume, kPixel).at<cv::Vec3b>(0, 0);
}

int brightest(const cv::Vec3b& pixel) { return std::max({pixel[0], pixel[1], pixel[2]}); }

TEST(TimePanel, EarlyIsBlueAndLateIsRedInEitherPolarity) {
  for (const int polarity : {0, 9}) {
    const cv::Vec3b early = pixel_of(polarity + 0, 10);
    const cv::Vec3b middle = pixel_of(polarity + 4, 10);
    const cv::Vec3b late = pixel_of(polarity + 8, 10);
    EXPECT_EQ(brightest(early), early[0]);
    EXPECT_EQ(brightest(middle), middle[1]);
    EXPECT_EQ(brightest(late), late[2]);
  }
}

TEST(TimePanel, PolaritiesAreWeightedByTheirEvents) {
  std::vector<float> volume(kPixel.value_count(), 0.0f);
  volume[0] = 3;      // positive, time 0.1
  volume[9 + 8] = 1;  // negative, time 1
  // (3 * 0.1 + 1 * 1) / 4 = 0.325; brightness 1 - exp(-4) = 0.98.
  const cv::Vec3b expected = time_colour(0.325f);
  const cv::Vec3b pixel = time_panel(volume, kPixel).at<cv::Vec3b>(0, 0);
  for (int channel = 0; channel < 3; ++channel) {
    EXPECT_NEAR(pixel[channel], expected[channel] * 0.98, 2);
  }
}

TEST(TimePanel, BrightnessIsAbsoluteAndUnsoundValuesAreWhite) {
  EXPECT_EQ(brightest(pixel_of(4, 0)), 0);
  // 1 - exp(-0.02) = 2 % of at most 255: noise stays faint.
  EXPECT_LE(brightest(pixel_of(4, 0.02f)), 6);
  EXPECT_GT(brightest(pixel_of(4, 0.02f)), 0);
  EXPECT_GT(brightest(pixel_of(4, 5)), 200);
  EXPECT_GT(brightest(pixel_of(4, std::numeric_limits<float>::max())), 200);
  const cv::Vec3b white(255, 255, 255);
  EXPECT_EQ(pixel_of(3, std::numeric_limits<float>::quiet_NaN()), white);
  EXPECT_EQ(pixel_of(12, std::numeric_limits<float>::infinity()), white);
}

TEST(PolarityPanel, IsRedOrBlueOnWhite) {
  const auto pixel = [](float positive, float negative) {
    std::vector<float> volume(kPixel.value_count(), 0.0f);
    volume[2] = positive;
    volume[9 + 5] = negative;
    return polarity_panel(volume, kPixel).at<cv::Vec3b>(0, 0);
  };
  EXPECT_EQ(pixel(0, 0), cv::Vec3b(255, 255, 255));
  EXPECT_EQ(pixel(50, 0), cv::Vec3b(0, 0, 230));
  EXPECT_EQ(pixel(0, 50), cv::Vec3b(230, 0, 0));
  const cv::Vec3b mixed = pixel(20, 60);
  EXPECT_NEAR(mixed[0], 230 * 0.75, 1);
  EXPECT_EQ(mixed[1], 0);
  EXPECT_NEAR(mixed[2], 230 * 0.25, 1);
  // Half of white and half of red where 1 - exp(-m) is a half.
  const cv::Vec3b half = pixel(std::log(2.0f), 0);
  EXPECT_NEAR(half[0], 127, 1);
  EXPECT_NEAR(half[2], 242, 1);
  EXPECT_EQ(pixel(std::numeric_limits<float>::quiet_NaN(), 1), cv::Vec3b(0, 0, 0));
}

TEST(TimePanel, OtherNumbersOfBins) {
  EXPECT_EQ(time_panel(std::vector<float>(2 * 6, 1.0f), {1, {2, 3}}).size(), cv::Size(3, 2));
}

/// Grey frames, no generated event, and a real one in the last bin at row 1, column 2.
ComparedPair pair_of(ImageSize size) {
  ComparedPair pair;
  pair.shape = {2, size};
  pair.frames.assign(2 * size.pixel_count(), 0.0f);
  pair.volumes.assign(2, {"generated", std::vector<float>(pair.shape.value_count(), 0.0f)});
  pair.volumes[1].name = "real";
  pair.volumes[1].volume[size.pixel_count() + static_cast<std::size_t>(size.width) + 2] = 5.0f;
  pair.title = "a pair";
  return pair;
}

TEST(WriteComparisonPng, ShowsFramesVolumesAndEventsABin) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "pairs.png";
  write_comparison_png(std::vector{pair_of({8, 160}), pair_of({8, 160})}, file);
  const cv::Mat image = cv::imread(file.string());
  // Panels of 160x8 enlarged twice, 6 pixels between them, 22 above and below each row.
  EXPECT_EQ(image.size(), cv::Size(5 * 326 + 6, 2 * (16 + 44)));
  const auto middle = [&](int panel) {
    return image.at<cv::Vec3b>(22 + 3, 6 + panel * 326 + 5);  // row 1, column 2, enlarged
  };
  EXPECT_EQ(middle(0), cv::Vec3b(128, 128, 128));
  EXPECT_EQ(middle(1), cv::Vec3b(128, 128, 128));
  EXPECT_EQ(middle(2), cv::Vec3b(0, 0, 0));
  EXPECT_GT(middle(3)[2], 200);  // late: red
  // Two bins: their middles at a quarter and at three quarters. The real line, the second colour,
  // rises from nothing to the largest, 95 % of the height; the generated one stays at the bottom.
  const auto plot = [&](int x, int y) { return image.at<cv::Vec3b>(22 + y, 6 + 4 * 326 + x); };
  EXPECT_GT(plot(240, 0)[0], 100);
  EXPECT_EQ(plot(240, 8), cv::Vec3b(0, 0, 0));
  EXPECT_GT(plot(240, 15)[0], 100);
  EXPECT_GT(plot(80, 15)[0], 100);
}

TEST(WriteComparisonPng, TakesPairsOfSeveralSizesThatFit) {
  const testing::TemporaryFolder folder;
  write_comparison_png(std::vector{pair_of({3, 400}), pair_of({3, 3})}, folder / "pairs.png");
  EXPECT_EQ(cv::imread((folder / "pairs.png").string()).cols, 5 * 406 + 6);
  ComparedPair pair = pair_of({4, 4});
  pair.volumes[1].volume.pop_back();
  EXPECT_THROWS(write_comparison_png(std::vector{pair}, "/tmp/never.png"), std::invalid_argument,
                "expected two frames and volumes of one size, got others");
  pair.volumes.clear();
  EXPECT_THROWS(write_comparison_png(std::vector{pair}, "/tmp/never.png"), std::invalid_argument,
                "expected two frames and volumes of one size, got others");
  EXPECT_THROWS(write_comparison_png({}, "/tmp/never.png"), std::invalid_argument,
                "expected pairs to compare, got none");
  EXPECT_THROWS(write_comparison_png(std::vector{pair_of({4, 4})}, "/nowhere/pairs.png"),
                std::runtime_error, "cannot create /nowhere");
}

}  // namespace
}  // namespace eventgan
