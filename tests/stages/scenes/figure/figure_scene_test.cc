#include "stages/scenes/figure/figure_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stages/scenes/figure/figure_casting.h"

namespace eventgan {
namespace {

constexpr Intrinsics kCamera{450, 450, 160, 120};

FigureScene scene_of(std::uint64_t seed) {
  return FigureScene(seed, kCamera, {cast_figure(seed, "test")});
}

bool shows_figure_near(const std::vector<int>& objects, const Point& point) {
  const ImageSize size = FigureScene::size();
  for (int y = static_cast<int>(point.y); y <= static_cast<int>(point.y) + 1; ++y) {
    for (int x = static_cast<int>(point.x); x <= static_cast<int>(point.x) + 1; ++x) {
      if (objects[static_cast<std::size_t>(y) * size.width + x] == 0) return true;
    }
  }
  return false;
}

TEST(FigureScene, EveryJointLiesOnTheFigure) {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    const FigureScene scene = scene_of(seed);
    const auto objects = scene.objects(4);
    const FigureLabel label = scene.labels(4).front();
    for (std::size_t joint = 0; joint < kFigureJoints; ++joint) {
      EXPECT_TRUE(shows_figure_near(objects, label.joints[joint])) << seed << " " << joint;
    }
  }
}

TEST(FigureScene, JointsAreTheProjectionOfThe3dOnes) {
  const FigureLabel label = scene_of(1).labels(2).front();
  for (std::size_t joint = 0; joint < kFigureJoints; ++joint) {
    const Vector3& at = label.joints3d[joint];
    EXPECT_NEAR(label.joints[joint].x, 450 * at.x / at.z + 160, 1e-9);
    EXPECT_NEAR(label.joints[joint].y, 450 * at.y / at.z + 120, 1e-9);
  }
}

TEST(FigureScene, OutlineFitsThePixelsWithinOne) {
  const FigureScene scene = scene_of(2);
  const auto objects = scene.objects(4);
  const ImageSize size = FigureScene::size();
  Rectangle seen{1e9, 1e9, -1e9, -1e9};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (objects[static_cast<std::size_t>(y) * size.width + x] != 0) continue;
      seen = {std::min(seen.left, double(x)), std::min(seen.top, double(y)),
              std::max(seen.right, x + 1.0), std::max(seen.bottom, y + 1.0)};
    }
  }
  const Rectangle outline = scene.labels(4).front().outline;
  EXPECT_NEAR(seen.left, outline.left, 1);
  EXPECT_NEAR(seen.top, outline.top, 1);
  EXPECT_NEAR(seen.right, outline.right, 1);
  EXPECT_NEAR(seen.bottom, outline.bottom, 1);
}

TEST(FigureScene, TheHeadBoxHoldsNeckAndHeadTopAndEndsAtIt) {
  const FigureLabel label = scene_of(3).labels(4).front();
  const Point top = label.joints[kHeadTop];
  EXPECT_GT(top.x, label.head_box.left);
  EXPECT_LT(top.x, label.head_box.right);
  EXPECT_GT(top.y, label.head_box.top);
  EXPECT_LT(top.y - label.head_box.top, 3);
  EXPECT_GT(label.head_box.bottom, label.joints[kNeck].y - 3);
}

TEST(FigureScene, ASidewaysFigureHidesItsFarShoulder) {
  FigureMotion motion = cast_figure(1, "test");
  motion.heading = 1.4;  // walks to the right, so that its right side is near
  motion.waves = false;
  const FigureLabel label = FigureScene(1, kCamera, {motion}).labels(0).front();
  EXPECT_TRUE(label.visible[kHeadTop]);
  EXPECT_NE(label.visible[kLeftShoulder], label.visible[kRightShoulder]);
  const bool left_is_near = label.joints3d[kLeftShoulder].z < label.joints3d[kRightShoulder].z;
  EXPECT_EQ(label.visible[kLeftShoulder], left_is_near);
}

TEST(FigureScene, ANearFigureHidesAFarOne) {
  FigureMotion near = cast_figure(1, "test");
  FigureMotion far = near;
  far.start.z += 1500;
  far.start.x *= far.start.z / near.start.z;  // on the same line of sight
  const auto labels = FigureScene(1, kCamera, {far, near}).labels(0);
  EXPECT_FALSE(labels[0].visible[kThorax]);
  EXPECT_TRUE(labels[1].visible[kThorax]);
}

TEST(FigureScene, OnlyTheFigureMoves) {
  const FigureScene scene = scene_of(4);
  const Picture before = scene.picture(3);
  const Picture after = scene.picture(4);
  const auto objects_before = scene.objects(3);
  const auto objects_after = scene.objects(4);
  const ImageSize size = FigureScene::size();
  std::size_t changed = 0;
  for (int y = 1; y + 1 < size.height; ++y) {
    for (int x = 1; x + 1 < size.width; ++x) {
      bool near_figure = false;
      for (const int offset : {-size.width - 1, -size.width, -size.width + 1, -1, 0, 1,
                               size.width - 1, size.width, size.width + 1}) {
        const std::size_t i = static_cast<std::size_t>(y * size.width + x + offset);
        near_figure = near_figure || objects_before[i] >= 0 || objects_after[i] >= 0;
      }
      const std::size_t i = 3 * (static_cast<std::size_t>(y) * size.width + x);
      const bool same =
          std::equal(before.bgr.begin() + i, before.bgr.begin() + i + 3, after.bgr.begin() + i);
      if (!near_figure) {
        EXPECT_TRUE(same) << x << " " << y;
      }
      changed += !same;
    }
  }
  EXPECT_GT(changed, 1000u);
  EXPECT_EQ(before, scene_of(4).picture(3));
}

}  // namespace
}  // namespace eventgan
