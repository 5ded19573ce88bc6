#include "pipeline/simulation/affine_scene.h"

#include <gtest/gtest.h>

#include <cmath>

namespace eventgan {
namespace {

/// A smooth picture, which bilinear interpolation renders well.
GreyImage waves(ImageSize size) {
  GreyImage image{size, {}};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      image.pixels.push_back(
          static_cast<std::uint8_t>(std::lround(128 + 60 * std::sin(x / 7.0) * std::cos(y / 5.0))));
    }
  }
  return image;
}

TEST(AffineScene, FramesFollowEachOtherByTheirFlow) {
  const ImageSize size{48, 64};
  const AffineMotion motion = random_affine_motion(size, 11, CounterRandom(3));
  AffineScene scene(waves(size), motion, 4, 0.1);
  EXPECT_EQ(scene.time_s(), 0);
  EXPECT_TRUE(scene.has_flow());
  int intervals = 0;
  for (GreyImage before = scene.frame(); const auto interval = scene.advance();
       before = scene.frame(), ++intervals) {
    // 11 px in 4 parts are at most 2.75 px each: 3 pictures at most 1 px apart.
    EXPECT_EQ(interval->steps(), 3);
    const FlowDisplacement flow = interval->flow();
    for (int y = 8; y < size.height - 8; ++y) {
      for (int x = 8; x < size.width - 8; ++x) {
        const auto i = static_cast<std::size_t>(y * size.width + x);
        const auto to_x = static_cast<int>(std::lround(x + flow.x_px[i]));
        const auto to_y = static_cast<int>(std::lround(y + flow.y_px[i]));
        const auto j = static_cast<std::size_t>(to_y * size.width + to_x);
        // Half a pixel of rounding times the steepest slope, 60/5 a pixel in both directions.
        EXPECT_NEAR(before.pixels[i], scene.frame().pixels[j], 13);
      }
    }
  }
  EXPECT_EQ(intervals, 3);
  EXPECT_DOUBLE_EQ(scene.time_s(), 0.3);
}

TEST(AffineScene, FlowOfATranslationIsTheSameEverywhere) {
  AffineMotion motion;
  motion.matrix = {1, 0, 6, 0, 1, -3};
  AffineScene scene(waves({20, 30}), motion, 3, 1);
  while (const auto interval = scene.advance()) {
    const FlowDisplacement flow = interval->flow();
    for (const float x : flow.x_px) EXPECT_NEAR(x, 2, 1e-5);
    for (const float y : flow.y_px) EXPECT_NEAR(y, -1, 1e-5);
  }
}

TEST(AffineScene, AnIntervalBeginsAndEndsWithItsFrames) {
  AffineScene scene(waves({20, 30}), random_affine_motion({20, 30}, 5, CounterRandom(1)), 3, 1);
  GreyImage before = scene.frame();
  while (const auto interval = scene.advance()) {
    const std::vector<float> first = interval->render(0);
    const std::vector<float> last = interval->render(interval->steps());
    for (std::size_t i = 0; i < first.size(); ++i) {
      EXPECT_NEAR(first[i] * 255, before.pixels[i], 0.51);
      EXPECT_NEAR(last[i] * 255, scene.frame().pixels[i], 0.51);
    }
    before = scene.frame();
  }
}

}  // namespace
}  // namespace eventgan
