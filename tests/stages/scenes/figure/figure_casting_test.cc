#include "stages/scenes/figure/figure_casting.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/scenes/camera.h"

namespace eventgan {
namespace {

constexpr Intrinsics kCamera{450, 450, 160, 120};

TEST(FigureCasting, EveryFigureStaysInThePictureAndMovesALittle) {
  const ImageSize size = FigureScene::size();
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const FigureMotion motion = cast_figure(seed, "role");
    double moved = 0;
    for (int frame = -10; frame <= 20; ++frame) {
      const Joints3d joints = pose(motion, frame);
      const Joints3d next = pose(motion, frame + 1);
      for (std::size_t joint = 0; joint < kFigureJoints; ++joint) {
        const Point at = project(kCamera, joints[joint]);
        const Point then = project(kCamera, next[joint]);
        ASSERT_TRUE(at.x > 0 && at.x < size.width - 1 && at.y > 0 && at.y < size.height - 1)
            << "seed " << seed << " frame " << frame << " joint " << joint << " at " << at.x << " "
            << at.y;
        moved += std::hypot(then.x - at.x, then.y - at.y) / (31.0 * kFigureJoints);
      }
    }
    EXPECT_GT(moved, 0.7) << "seed " << seed;
    EXPECT_LT(moved, 3) << "seed " << seed;
  }
}

TEST(FigureCasting, RolesAndSeedsDiffer) {
  EXPECT_EQ(cast_figure(1, "a").phase, cast_figure(1, "a").phase);
  EXPECT_NE(cast_figure(1, "a").phase, cast_figure(1, "b").phase);
  EXPECT_NE(cast_figure(1, "a").phase, cast_figure(2, "a").phase);
}

TEST(FigureCasting, AnotherCameraSeesTheSameBody) {
  const FigureMotion motion = cast_figure(1, "a");
  const Vector3 pivot{0, 0, 4700};
  const double angle = 1.1;
  const FigureMotion turned = seen_from(motion, pivot, angle);
  for (const double frame : {0.0, 9.0}) {
    const Joints3d joints = pose(motion, frame);
    const Joints3d seen = pose(turned, frame);
    for (std::size_t joint = 0; joint < kFigureJoints; ++joint) {
      // Each joint turned about the pivot by itself.
      const Vector3 off = joints[joint] - pivot;
      const Vector3 expected{pivot.x + std::cos(angle) * off.x - std::sin(angle) * off.z, off.y,
                             pivot.z + std::sin(angle) * off.x + std::cos(angle) * off.z};
      EXPECT_NEAR(length(seen[joint] - expected), 0, 1e-9) << joint;
    }
  }
}

}  // namespace
}  // namespace eventgan
