#include "stages/events/simulation/affine_motion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "stages/events/simulation/linear_intensity.h"
#include "tests/stages/events/simulation/textured_picture.h"

namespace eventgan {
namespace {

using testing::texture;
using testing::textured_picture;

AffineMotion shift(double dx, double dy) { return {{1, 0, dx, 0, 1, dy}}; }

TEST(RandomAffineMotion, HasTheDisplacementAskedFor) {
  for (const ImageSize size : {ImageSize{1, 1}, {1, 9}, {8, 8}, {180, 320}, {261, 99}}) {
    for (const double displacement : {0.0, 0.01, 1.0, 6.0, 40.0}) {
      for (std::uint64_t seed = 0; seed < 20; ++seed) {
        const AffineMotion motion = random_affine_motion(size, displacement, CounterRandom(seed));
        EXPECT_NEAR(largest_displacement(motion, size), displacement, 1e-9);
        const auto& m = motion.matrix;
        // ‖A₁ - I‖ ≤ 1/2 keeps the determinant at 1/4 or more.
        EXPECT_GE(m[0] * m[4] - m[1] * m[3], 0.25 - 1e-9);
      }
    }
  }
}

TEST(RandomAffineMotion, DiffersBySeedAndIsMoreThanATranslation) {
  const AffineMotion one = random_affine_motion({180, 320}, 6, CounterRandom(1));
  EXPECT_EQ(one.matrix, random_affine_motion({180, 320}, 6, CounterRandom(1)).matrix);
  EXPECT_NE(one.matrix, random_affine_motion({180, 320}, 6, CounterRandom(2)).matrix);
  EXPECT_NE(one.matrix[0], 1);
  EXPECT_NE(one.matrix[1], 0);
}

TEST(RandomAffineMotion, RefusesBadDisplacements) {
  for (const double bad : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THROW(random_affine_motion({8, 8}, bad, CounterRandom(1)), std::invalid_argument);
  }
}

TEST(RenderAffine, IsThePictureAtTheStart) {
  const GreyImage picture = textured_picture({37, 53});
  const AffineMotion motion = random_affine_motion(picture.size, 6, CounterRandom(1));
  EXPECT_EQ(render_affine(picture, motion, 0), linear_intensity(picture));
}

TEST(RenderAffine, MovesTheWayOfTheMatrix) {
  const GreyImage picture{{1, 5}, {10, 20, 30, 40, 50}};
  const std::vector<float> moved = render_affine(picture, shift(2, 0), 1);
  // Right by two; mirrored about the first pixel at the left.
  EXPECT_EQ(moved, linear_intensity({{1, 5}, {30, 20, 10, 20, 30}}));
  const std::vector<float> halfway = render_affine(picture, shift(3, 0), 0.5);
  EXPECT_NEAR(halfway[3] * 255, 25, 1e-4);  // bilinear between 20 and 30
}

TEST(RenderAffine, TakesAPictureOfOnePixel) {
  EXPECT_EQ(render_affine({{1, 1}, {51}}, shift(3, 2), 1), std::vector<float>{0.2f});
}

TEST(AffineInterval, TakesStepsOfAPixelAtMost) {
  const auto steps = [](const AffineMotion& motion) {
    return AffineInterval(textured_picture({9, 9}), motion).steps();
  };
  EXPECT_EQ(steps({}), 1);
  EXPECT_EQ(steps(shift(0.2, 0)), 1);
  EXPECT_EQ(steps(shift(1, 0)), 1);
  EXPECT_EQ(steps(shift(1.01, 0)), 2);
  EXPECT_EQ(steps(shift(3, 4)), 5);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    EXPECT_EQ(steps(random_affine_motion({9, 9}, 6, CounterRandom(seed))), 6);
  }
}

TEST(AffineInterval, FlowLeadsFromThePictureToTheLastRendered) {
  const GreyImage picture = textured_picture({60, 80});
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const AffineMotion motion = random_affine_motion(picture.size, 6, CounterRandom(seed));
    const AffineInterval interval(picture, motion);
    EXPECT_EQ(interval.size(), picture.size);
    const FlowDisplacement flow = interval.flow();
    const std::vector<float> last = interval.render(interval.steps());
    double largest = 0;
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 80; ++x) {
        // What lands on an inner pixel (x, y) comes from p with p + flow(p) = (x, y); the flow is
        // smooth, so that fixed point is found in some rounds.
        double px = x;
        double py = y;
        const auto& m = motion.matrix;
        for (int round = 0; round < 60; ++round) {
          const double dx = (m[0] - 1) * px + m[1] * py + m[2];
          const double dy = m[3] * px + (m[4] - 1) * py + m[5];
          px = x - dx;
          py = y - dy;
        }
        if (px < 0 || py < 0 || px > 79 || py > 59) continue;
        const double seen = last[static_cast<std::size_t>(y * 80 + x)];
        largest = std::max(largest, std::abs(seen - texture(px, py)));
      }
    }
    // Slope at most 0.2 a pixel: 1/64 px of rounded place an axis, second differences below 0.15
    // / 8 an axis for bilinear, half a grey level.
    EXPECT_LT(largest, 0.2 / 64 * 2 + 0.15 / 8 * 2 + 0.002) << seed;
    for (const int place : {0, 79, 80 * 30 + 41, 80 * 59, 80 * 60 - 1}) {
      const int x = place % 80;
      const int y = place / 80;
      const auto& m = motion.matrix;
      const auto i = static_cast<std::size_t>(place);
      EXPECT_FLOAT_EQ(flow.x_px[i], static_cast<float>((m[0] - 1) * x + m[1] * y + m[2]));
      EXPECT_FLOAT_EQ(flow.y_px[i], static_cast<float>(m[3] * x + (m[4] - 1) * y + m[5]));
    }
  }
}

}  // namespace
}  // namespace eventgan
