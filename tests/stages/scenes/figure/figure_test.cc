#include "stages/scenes/figure/figure.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

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

TEST(Figure, FacingTheCameraItsLeftIsOnTheRightOfThePicture) {
  FigureMotion motion = walker();
  motion.heading = 0;
  const Joints3d joints = pose(motion, 0);
  EXPECT_GT(joints[kLeftShoulder].x, joints[kRightShoulder].x);
  EXPECT_LT(joints[kHeadTop].y, joints[kHips].y);
  EXPECT_LT(joints[kRightWrist].y, joints[kRightElbow].y) << "it waves";
  // Toes point forwards, towards the camera.
  EXPECT_LT(joints[kLeftToe].z, joints[kLeftAnkle].z);
}

TEST(Figure, EveryJointLiesInsideALimb) {
  const Joints3d joints = pose(walker(), 5);
  const auto bars = limbs(joints, {100, 100, 100});
  for (std::size_t joint = 0; joint < kFigureJoints; ++joint) {
    EXPECT_TRUE(std::any_of(bars.begin(), bars.end(), [&](const Limb3d& limb) {
      return is_inside(limb, joints[joint]);
    })) << joint;
  }
}

TEST(Figure, InsideALimbIsWithinItsRadiusOfItsLine) {
  const Limb3d limb{{0, 0, 0}, {100, 0, 0}, 10, {}};
  EXPECT_TRUE(is_inside(limb, {50, 6, 8}));
  EXPECT_TRUE(is_inside(limb, {-10, 0, 0}));
  EXPECT_FALSE(is_inside(limb, {50, 8, 8}));
  EXPECT_FALSE(is_inside(limb, {108, 8, 0}));
  EXPECT_TRUE(is_inside({{1, 1, 1}, {1, 1, 1}, 2, {}}, {1, 1, 3}));
}

}  // namespace
}  // namespace eventgan
