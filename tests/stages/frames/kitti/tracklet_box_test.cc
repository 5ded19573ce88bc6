#include "stages/frames/kitti/tracklet_box.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "stages/frames/kitti/kitti_label.h"

namespace eventgan {
namespace {

using ::testing::FloatNear;
using ::testing::Pointwise;

constexpr double kPi = std::numbers::pi;

/// As tests/stages/frames/kitti/raw_fixture.h: the scanner's (x, y, z) is seen at
/// (50 - 100 y/x, 20 - 100 z/x) in a picture of 100 x 40 pixels.
const RawCalibration kCalibration{{0, -1, 0, 0, 0, -1, 1, 0, 0},
                                  {0, 0, 0},
                                  {1, 0, 0, 0, 1, 0, 0, 0, 1},
                                  {100, 0, 50, 0, 0, 100, 20, 0, 0, 0, 1, 0},
                                  {40, 100}};

/// A car 2 m high, 1 m wide and 4 m long that drives straight ahead.
TrackletPose car(double x, double y, double z, double rotation_z = 0) {
  TrackletPose pose;
  pose.class_id = kitti_class_id("Car");
  pose.height = 2;
  pose.width = 1;
  pose.length = 4;
  pose.x = x;
  pose.y = y;
  pose.z = z;
  pose.rotation_z = rotation_z;
  pose.occlusion = 1;
  pose.truncation = 0;
  pose.track = 7;
  return pose;
}

TEST(TrackletBox, SurroundsTheProjectedCuboid) {
  const auto box = to_box(car(12, 0, -1), kCalibration);
  ASSERT_TRUE(box);
  // The rear, 10 m away, is the largest: half a metre to each side, a metre up and down.
  EXPECT_NEAR(box->xyxy.left, 50 - 100 * 0.5 / 10, 1e-9);
  EXPECT_NEAR(box->xyxy.right, 50 + 100 * 0.5 / 10, 1e-9);
  EXPECT_NEAR(box->xyxy.top, 20 - 100 * 1.0 / 10, 1e-9);
  EXPECT_NEAR(box->xyxy.bottom, 20 + 100 * 1.0 / 10, 1e-9);
  EXPECT_EQ(box->class_id, kitti_class_id("Car"));
  EXPECT_EQ(box->occlusion, 1);
  EXPECT_EQ(box->truncation, 0);
  EXPECT_EQ(box->track_id, 7);
  EXPECT_FALSE(box->ignore);
}

TEST(TrackletBox, ATurnedCuboidShowsItsLength) {
  const auto box = to_box(car(12, 0, -1, kPi / 2), kCalibration);
  ASSERT_TRUE(box);
  // Now 4 m across and 1 m deep: the near side is 11.5 m away.
  EXPECT_NEAR(box->xyxy.right - box->xyxy.left, 100 * 4 / 11.5, 1e-9);
}

TEST(TrackletBox, PlacesTheUndersideInTheRectifiedFrame) {
  const auto box = to_box(car(12, 2, -1), kCalibration);
  ASSERT_TRUE(box);
  const std::array<float, 7> expected{2, 1, 4, -2, 1, 12, static_cast<float>(-kPi / 2)};
  EXPECT_THAT(box->box3d, Pointwise(FloatNear(1e-6f), expected));
  // The car lies to the left, at atan2(-2, 12).
  EXPECT_NEAR(box->alpha, -kPi / 2 + std::atan2(2, 12), 1e-6);
}

// KITTI object's cuboid: corner (l/2, 0, 0) turned by rotation_y about the camera's y, (x, y, z) ->
// (x cos + z sin, y, -x sin + z cos). It must be the front that the scanner sees.
TEST(TrackletBox, RotationYTurnsTheLengthAsRotationZDoes) {
  for (double rotation_z = -3; rotation_z <= 3; rotation_z += 0.5) {
    const TrackletPose pose = car(20, 1, -1, rotation_z);
    const auto box = to_box(pose, kCalibration);
    ASSERT_TRUE(box);
    const double ry = box->box3d[6];
    EXPECT_LE(std::abs(ry), kPi + 1e-6);
    const Point3 front = kCalibration.to_rectified(
        {pose.x + 2 * std::cos(rotation_z), pose.y + 2 * std::sin(rotation_z), pose.z});
    EXPECT_NEAR(box->box3d[3] + 2 * std::cos(ry), front[0], 1e-5);
    EXPECT_NEAR(box->box3d[5] - 2 * std::sin(ry), front[2], 1e-5);
  }
}

TEST(TrackletBox, IsCutToThePicture) {
  const auto box = to_box(car(12, 5, -1), kCalibration);  // left edge at 50 - 100 5.5/10 = -5
  ASSERT_TRUE(box);
  EXPECT_EQ(box->xyxy.left, 0);
  EXPECT_NEAR(box->xyxy.right, 50 - 100 * 4.5 / 14, 1e-9);  // of the front, 14 m away
}

TEST(TrackletBox, AnObjectBesideTheCameraReachesToThePicturesEdge) {
  // From 2 m behind the camera to 2 m before it, half a metre to a metre and a half to the left.
  // Its right edge is the far inner one, 50 - 100 0.5/2; on the left it runs out of the picture.
  const auto box = to_box(car(0, 1, -1), kCalibration);
  ASSERT_TRUE(box);
  EXPECT_NEAR(box->xyxy.right, 25, 1e-9);
  EXPECT_EQ(box->xyxy.left, 0);
  EXPECT_EQ(box->xyxy.top, 0);
  EXPECT_EQ(box->xyxy.bottom, 39);
}

TEST(TrackletBox, EndsAtTheLastPixelAsKittisOwnLabelsDo) {
  // From 2 m behind the camera to 2 m before it, to its right: out of the picture on that side.
  const auto box = to_box(car(0, -1, -1), kCalibration);
  ASSERT_TRUE(box);
  EXPECT_EQ(box->xyxy, (Rectangle{75, 0, 99, 39}));  // 50 + 100 0.5/2; 100 x 40 pixels
}

TEST(TrackletBox, NothingBehindTheCameraOrOutsideThePictureIsSeen) {
  EXPECT_FALSE(to_box(car(-12, 0, -1), kCalibration));
  EXPECT_FALSE(to_box(car(12, 20, -1), kCalibration));
  EXPECT_FALSE(to_box(car(12, 0, 10), kCalibration));
}

TEST(TrackletBox, ATruncationThatIsNotAFractionIsUnknown) {
  TrackletPose pose = car(12, 0, -1);
  pose.truncation = 1;
  EXPECT_EQ(to_box(pose, kCalibration)->truncation, -1);
}

}  // namespace
}  // namespace eventgan
