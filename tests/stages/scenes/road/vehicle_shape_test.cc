#include "stages/scenes/road/vehicle_shape.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

namespace eventgan {
namespace {

/// 4 m long, 10 m ahead, seen from behind.
Vehicle car_ahead() {
  Vehicle car;
  car.type = "Car";
  car.height = 1.5;
  car.width = 1.6;
  car.length = 4;
  car.location = {0, 1.65, 10};
  car.rotation_y = -std::numbers::pi / 2;
  car.paint = {10, 20, 200};
  return car;
}

TEST(VehicleShape, ARayMeetsTheRearFirst) {
  const VehicleShape shape(car_ahead());
  // The middle of the body is 0.3 to 0.9 m above the ground, so about 1 m below the camera; the
  // rear face is at z = 10 - 4 / 2.
  const auto hit = shape.hit({0, 1.05 / 8, 1});
  ASSERT_TRUE(hit.has_value());
  EXPECT_NEAR(hit->distance, 8, 1e-9);
}

TEST(VehicleShape, RaysBesideAboveAndBehindTheCameraMiss) {
  const VehicleShape shape(car_ahead());
  EXPECT_FALSE(shape.hit({0, 0.1 / 8, 1}).has_value()) << "the roof is 0.15 m below the camera";
  EXPECT_FALSE(shape.hit({0.85 / 8, 1.05 / 8, 1}).has_value()) << "half a width is 0.8 m";
  Vehicle behind = car_ahead();
  behind.location.z = -10;
  EXPECT_FALSE(VehicleShape(behind).hit({0, 1.05 / 8, 1}).has_value());
}

TEST(VehicleShape, FacesFillTheBoxThatTheLabelDescribes) {
  Vehicle car = car_ahead();
  car.rotation_y = 0;  // its front along x
  double left = 1e9, right = -1e9, top = 1e9, bottom = -1e9, near = 1e9, far = -1e9;
  for (const auto& face : VehicleShape(car).faces()) {
    for (const Vector3& corner : face) {
      left = std::min(left, corner.x);
      right = std::max(right, corner.x);
      top = std::min(top, corner.y);
      bottom = std::max(bottom, corner.y);
      near = std::min(near, corner.z);
      far = std::max(far, corner.z);
    }
  }
  EXPECT_NEAR(left, -2, 1e-9);
  EXPECT_NEAR(right, 2, 1e-9);
  EXPECT_NEAR(top, 1.65 - 1.5, 1e-9);
  EXPECT_NEAR(bottom, 1.65, 1e-9);
  EXPECT_NEAR(near, 10 - 0.8, 1e-9);
  EXPECT_NEAR(far, 10 + 0.8, 1e-9);
}

TEST(VehicleShape, FacesAreFlatRectangles) {
  Vehicle car = car_ahead();
  car.rotation_y = 0.4;
  for (const auto& face : VehicleShape(car).faces()) {
    // Opposite sides of a rectangle are equal, neighbours at right angles.
    EXPECT_NEAR(length((face[1] - face[0]) - (face[2] - face[3])), 0, 1e-9);
    EXPECT_NEAR(dot(face[1] - face[0], face[3] - face[0]), 0, 1e-9);
    EXPECT_GT(length(face[1] - face[0]), 0);
    EXPECT_GT(length(face[3] - face[0]), 0);
  }
}

TEST(VehicleShape, TheFrontPointsWhereKittisAngleSays) {
  Vehicle car = car_ahead();
  car.rotation_y = 0;
  // The bonnet is lower than the roof, and lies towards +x.
  double roof_right = -1e9;
  for (const auto& face : VehicleShape(car).faces()) {
    for (const Vector3& corner : face) {
      if (corner.y < 0.2) roof_right = std::max(roof_right, corner.x);
    }
  }
  EXPECT_LT(roof_right, 1.5);
}

TEST(VehicleShape, ShadeLiesUnderIt) {
  const VehicleShape shape(car_ahead());
  EXPECT_TRUE(shape.shades({0.7, 1.65, 8.2}));
  EXPECT_TRUE(shape.shades({0.8 + 0.9 * VehicleShape::kShade, 1.65, 10}));
  EXPECT_FALSE(shape.shades({1.2, 1.65, 10}));
  EXPECT_FALSE(shape.shades({0, 1.65, 7.5}));
}

}  // namespace
}  // namespace eventgan
