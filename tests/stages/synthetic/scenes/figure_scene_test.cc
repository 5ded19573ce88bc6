#include "stages/synthetic/scenes/figure_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/synthetic/scenes/camera.h"
#include "stages/synthetic/scenes/figure.h"

namespace eventgan {
namespace {

FigureMotion walker() {
  FigureMotion motion;
  motion.start = {100, 950, 4700};
  motion.step = {10, 0, 2};
  motion.heading = 0.7;
  motion.waves = true;
  return motion;
}

TEST(Figure, BonesKeepTheirLength) {
  const Joints3d first = pose(walker(), 0);
  for (const double frame : {1.0, 7.5, 40.0}) {
    const Joints3d later = pose(walker(), frame);
    for (const auto& [from, to] : {std::pair{kRightHip, kRightKnee},
                                   {kRightKnee, kRightAnkle},
                                   {kRightAnkle, kRightToe},
                                   {kLeftHip, kLeftKnee},
                                   {kHips, kThorax},
                                   {kThorax, kRightShoulder},
                                   {kRightShoulder, kRightElbow},
                                   {kRightElbow, kRightWrist},
                                   {kLeftElbow, kLeftWrist},
                                   {kNeck, kHeadTop}}) {
      EXPECT_NEAR(length(later[to] - later[from]), length(first[to] - first[from]), 1e-9)
          << from << "-" << to << " at " << frame;
    }
  }
}

TEST(Figure, JointsThatHuman36mPutsOnOnePlaceCoincide) {
  const Joints3d joints = pose(walker(), 3);
  for (const auto& [one, other] : {std::pair{kHips, kSpineBase},
                                   {kThorax, kLeftCollar},
                                   {kThorax, kRightCollar},
                                   {kLeftWrist, kLeftHand},
                                   {kRightWrist, kRightHand},
                                   {kLeftFingers, kLeftFingersEnd},
                                   {kRightFingers, kRightFingersEnd}}) {
    EXPECT_EQ(length(joints[one] - joints[other]), 0) << one << " " << other;
  }
}

TEST(Figure, FacingTheCameraItsLeftIsOnTheRightOfTheImage) {
  FigureMotion motion = walker();
  motion.heading = 0;
  const Joints3d joints = pose(motion, 0);
  EXPECT_GT(joints[kLeftShoulder].x, joints[kRightShoulder].x);
  EXPECT_LT(joints[kHeadTop].y, joints[kHips].y);
  EXPECT_LT(joints[kRightWrist].y, joints[kRightElbow].y) << "it waves";
  // Toes point forwards, towards the camera.
  EXPECT_LT(joints[kLeftToe].z, joints[kLeftAnkle].z);
}

TEST(Figure, EveryJointLiesInsideALimbWithinItsRadius) {
  const Joints3d joints = pose(walker(), 5);
  const auto bars = limbs(joints, {100, 100, 100});
  for (std::size_t joint = 0; joint < kFigureJoints; ++joint) {
    EXPECT_TRUE(std::any_of(bars.begin(), bars.end(), [&](const Limb3d& limb) {
      return is_inside(limb, joints[joint]);
    })) << joint;
  }
  const Limb3d limb{{0, 0, 0}, {100, 0, 0}, 10, {}};
  EXPECT_TRUE(is_inside(limb, {50, 6, 8}));
  EXPECT_TRUE(is_inside(limb, {-10, 0, 0}));
  EXPECT_FALSE(is_inside(limb, {50, 8, 8}));
  EXPECT_FALSE(is_inside(limb, {108, 8, 0}));
  EXPECT_TRUE(is_inside({{1, 1, 1}, {1, 1, 1}, 2, {}}, {1, 1, 3}));
}

constexpr Intrinsics kCamera{450, 450, 160, 120};

TEST(FigureCasting, EveryFigureStaysInTheImageAndMovesALittle) {
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

constexpr Intrinsics kLimbCamera{100, 100, 10, 10};
constexpr ImageSize kSize{21, 31};

/// A bar 10 px long and 2 px in radius at a distance of 1 m: 100 px a metre.
Limb3d bar() { return {{0, 0, 1000}, {100, 0, 1000}, 20, {100, 100, 100}}; }

TEST(LimbDrawing, ProjectsScalesAndPlacesBeside) {
  const DrawnLimb drawn = drawn_limb(bar(), kLimbCamera);
  EXPECT_EQ(drawn.from, (Point{10, 10}));
  EXPECT_EQ(drawn.to, (Point{20, 10}));
  EXPECT_DOUBLE_EQ(drawn.radius, 2);
  // Centres from 8 to 22 and 8 to 12, edges half a pixel on.
  EXPECT_EQ(bounds_of(drawn), (Rectangle{8.5, 8.5, 22.5, 12.5}));
  EXPECT_DOUBLE_EQ(place_on(drawn, {15, 13}).distance, 3);
  EXPECT_DOUBLE_EQ(place_on(drawn, {15, 13}).along, 0.5);
  EXPECT_DOUBLE_EQ(place_on(drawn, {23, 14}).distance, 5);  // 3 beyond, 4 beside
  EXPECT_DOUBLE_EQ(place_on(drawn, {0, 10}).along, 0);
  const DrawnLimb ball{{5, 5}, {5, 5}, 1, 1000};
  EXPECT_DOUBLE_EQ(place_on(ball, {8, 9}).distance, 5);
}

TEST(LimbDrawing, CoversItsPixelsAndSoftensItsEdge) {
  std::vector<Colour> canvas(kSize.pixel_count());
  std::vector<int> objects(kSize.pixel_count(), -1);
  draw_limb(bar(), kLimbCamera, Texture(CounterRandom(1)), 5, kSize, canvas, objects);
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y) * kSize.width + x; };
  EXPECT_EQ(objects[at(15, 10)], 5);
  EXPECT_EQ(objects[at(15, 12)], 5);
  EXPECT_EQ(objects[at(15, 13)], -1);
  EXPECT_GT(canvas[at(15, 10)].red, 70);  // pattern from 0.75
  EXPECT_GT(canvas[at(15, 12)].red, 0);   // on the edge: half covered
  EXPECT_LT(canvas[at(15, 12)].red, 0.5f * 1.25f * 100);
  EXPECT_EQ(canvas[at(15, 13)].red, 0);  // a pixel off
}

TEST(LimbDrawing, WhatLiesOutsideTheImageIsCut) {
  std::vector<Colour> canvas(kSize.pixel_count());
  std::vector<int> objects(kSize.pixel_count(), -1);
  Limb3d long_bar = bar();
  long_bar.from.x = -5000;
  long_bar.to.x = 5000;
  draw_limb(long_bar, kLimbCamera, Texture(CounterRandom(1)), 0, kSize, canvas, objects);
  EXPECT_EQ(objects[10 * kSize.width], 0);
  EXPECT_EQ(objects[10 * kSize.width + kSize.width - 1], 0);
}

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

TEST(FigureScene, EveryJointLiesOnTheFigureAndIsTheProjectionOfThe3dOne) {
  for (const std::uint64_t seed : {1, 2, 3, 4, 5}) {
    const FigureScene scene = scene_of(seed);
    const auto objects = scene.objects(4);
    const FigureLabel label = scene.labels(4).front();
    for (std::size_t joint = 0; joint < kFigureJoints; ++joint) {
      EXPECT_TRUE(shows_figure_near(objects, label.joints[joint])) << seed << " " << joint;
    }
  }
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
  const Image before = scene.render(3);
  const Image after = scene.render(4);
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
  EXPECT_EQ(before, scene_of(4).render(3));
}

}  // namespace
}  // namespace eventgan
