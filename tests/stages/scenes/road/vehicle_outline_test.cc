#include "stages/scenes/road/vehicle_outline.h"

#include <gtest/gtest.h>

#include <numbers>

namespace eventgan {
namespace {

constexpr Intrinsics kCamera{100, 100, 50, 40};
constexpr ImageSize kPicture{80, 100};

/// 4 m long and 2 m wide, driving away.
VehicleShape car_at(double x, double z) {
  Vehicle car;
  car.type = "Car";
  car.height = 1.5;
  car.width = 2;
  car.length = 4;
  car.location = {x, 1.5, z};
  car.rotation_y = -std::numbers::pi / 2;
  return VehicleShape(car);
}

TEST(VehicleOutline, IsTheNearFacesProjection) {
  // The rear face of the body is at z = 10, x from -1 to 1: u = 50 -+ 100 / 10, edges half a pixel
  // on. The ground under the rear wheels (radius 0.2 x 1.5, their axle 0.62 x 2 m behind the
  // middle) is nearest at z = 12 - 1.24 - 0.3 = 10.46, so v = 40 + 100 x 1.5 / 10.46.
  const Rectangle outline = whole_outline(car_at(0, 12), kCamera);
  EXPECT_NEAR(outline.left, 40.5, 1e-9);
  EXPECT_NEAR(outline.right, 60.5, 1e-9);
  EXPECT_NEAR(outline.bottom, 40.5 + 150 / 10.46, 1e-9);
  EXPECT_EQ(visible_outline(car_at(0, 12), kCamera, kPicture), outline);
}

TEST(VehicleOutline, EndsAtThePicturesBorder) {
  const VehicleShape car = car_at(7, 12);
  const Rectangle whole = whole_outline(car, kCamera);
  const Rectangle seen = visible_outline(car, kCamera, kPicture);
  EXPECT_NEAR(whole.left, 50.5 + 100 * 6 / 14.0, 1e-9) << "the far end is nearest to the middle";
  EXPECT_NEAR(whole.right, 50.5 + 100 * 8 / 10.0, 1e-9);
  EXPECT_NEAR(seen.left, whole.left, 1e-9);
  EXPECT_NEAR(seen.right, 100, 1e-9);
  EXPECT_LT(seen.bottom, whole.bottom) << "the lowest point lies outside";
}

TEST(VehicleOutline, AVehicleBesideTheCameraIsCutBeforeIt) {
  // Its inner side is at x = -3, its far end at z = 5: u = 50 - 60, outside the picture.
  const Rectangle beside = visible_outline(car_at(-4, 3), kCamera, kPicture);
  EXPECT_GT(beside.left, beside.right);
  const Rectangle nearer = visible_outline(car_at(-3, 5), kCamera, kPicture);
  // Inner side at x = -2, far end at z = 7; its near end is behind the border.
  EXPECT_EQ(nearer.left, 0);
  EXPECT_NEAR(nearer.right, 50.5 - 200 / 7.0, 1e-9);
}

TEST(VehicleOutline, BehindTheCameraIsEmpty) {
  const Rectangle outline = whole_outline(car_at(0, -10), kCamera);
  EXPECT_GT(outline.left, outline.right);
}

}  // namespace
}  // namespace eventgan
