#include "stages/events/simulation/flow_interval.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>

#include "stages/events/simulation/linear_intensity.h"
#include "tests/stages/events/simulation/textured_picture.h"

namespace eventgan {
namespace {

using testing::texture;
using testing::textured_picture;

constexpr ImageSize kSize{90, 120};

/// PSNR in dB of a rendered picture against the texture moved right by dx, `margin` px inside.
double psnr(const std::vector<float>& rendered, double dx, int margin) {
  double squares = 0;
  int count = 0;
  for (int y = margin; y < kSize.height - margin; ++y) {
    for (int x = margin; x < kSize.width - margin; ++x, ++count) {
      const double error =
          rendered[static_cast<std::size_t>(y * kSize.width + x)] - texture(x - dx, y);
      squares += error * error;
    }
  }
  return -10 * std::log10(squares / count);
}

TEST(FlowInterval, BeginsAndEndsWithTheFrames) {
  const GreyImage previous = textured_picture(kSize);
  const GreyImage next = textured_picture(kSize, 6);
  const FlowInterval interval(previous, next);
  EXPECT_EQ(interval.size(), kSize);
  EXPECT_EQ(interval.render(0), linear_intensity(previous));
  EXPECT_EQ(interval.render(interval.steps()), linear_intensity(next));
}

TEST(FlowInterval, MovesATextureAlongItsShift) {
  const FlowInterval interval(textured_picture(kSize), textured_picture(kSize, 6));
  EXPECT_GE(interval.steps(), 6);
  EXPECT_LE(interval.steps(), 8);
  for (int step = 1; step < interval.steps(); ++step) {
    const std::vector<float> rendered = interval.render(step);
    const double dx = 6.0 * step / interval.steps();
    // Half a grey level of rounding would give 59 dB; the flow's error of some 0.05 px costs most.
    EXPECT_GT(psnr(rendered, dx, 10), 45) << step;
    EXPECT_GT(psnr(rendered, dx, 0), 40) << step;
  }
}

TEST(FlowInterval, FlowIsTheShift) {
  const FlowDisplacement flow =
      FlowInterval(textured_picture(kSize), textured_picture(kSize, 4, -3)).flow();
  double error = 0;
  for (int y = 15; y < kSize.height - 15; ++y) {
    for (int x = 15; x < kSize.width - 15; ++x) {
      const auto i = static_cast<std::size_t>(y * kSize.width + x);
      error = std::max(error, std::hypot(flow.x_px[i] - 4.0, flow.y_px[i] + 3.0));
    }
  }
  EXPECT_LT(error, 0.2);
}

TEST(FlowInterval, StaysStillBetweenEqualFrames) {
  const GreyImage picture = textured_picture(kSize);
  const FlowInterval interval(picture, picture);
  EXPECT_EQ(interval.steps(), 1);
  for (const float x : interval.flow().x_px) EXPECT_NEAR(x, 0, 0.01);
}

TEST(FlowInterval, ABrighteningPictureWithoutTextureFades) {
  const GreyImage dark{kSize, std::vector<std::uint8_t>(kSize.pixel_count(), 0)};
  const GreyImage bright{kSize, std::vector<std::uint8_t>(kSize.pixel_count(), 255)};
  const FlowInterval interval(dark, bright);
  const int half = interval.steps() / 2;
  const float expected = static_cast<float>(half) / static_cast<float>(interval.steps());
  for (const float value : interval.render(half)) EXPECT_NEAR(value, expected, 1e-4);
}

TEST(FlowInterval, TakesTheSmallestAndOddSizes) {
  for (const ImageSize size : {ImageSize{1, 1}, {1, 40}, {7, 3}, {33, 65}, {200, 5}}) {
    const FlowInterval interval(textured_picture(size), textured_picture(size, 2));
    for (int step = 0; step <= interval.steps(); ++step) {
      const std::vector<float> rendered = interval.render(step);
      ASSERT_EQ(rendered.size(), size.pixel_count());
      for (const float value : rendered) EXPECT_TRUE(value >= 0 && value <= 1) << value;
    }
  }
}

TEST(FlowInterval, DoesNotDependOnTheNumberOfThreads) {
  const auto picture_at = [](int threads) {
    const int before = cv::getNumThreads();
    cv::setNumThreads(threads);
    const FlowInterval interval(textured_picture(kSize), textured_picture(kSize, 5, 2));
    const std::vector<float> rendered = interval.render(2);
    cv::setNumThreads(before);
    return rendered;
  };
  EXPECT_EQ(picture_at(1), picture_at(3));
}

TEST(FlowInterval, RefusesFramesOfTwoSizesAndNone) {
  EXPECT_THROW(FlowInterval(textured_picture({9, 8}), textured_picture({8, 9})),
               std::invalid_argument);
  EXPECT_THROW(FlowInterval(GreyImage{}, GreyImage{}), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
