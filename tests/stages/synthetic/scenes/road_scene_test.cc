#include "stages/synthetic/scenes/road_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "stages/synthetic/scenes/camera.h"
#include "stages/synthetic/scenes/vehicle.h"

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

TEST(VehicleShape, ARayMeetsTheRearFirstOrMisses) {
  const VehicleShape shape(car_ahead());
  // The middle of the body is 0.3 to 0.9 m above the ground, so about 1 m below the camera; the
  // rear face is at z = 10 - 4 / 2.
  const auto hit = shape.hit({0, 1.05 / 8, 1});
  ASSERT_TRUE(hit.has_value());
  EXPECT_NEAR(hit->distance, 8, 1e-9);
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

constexpr Intrinsics kRoadCamera{100, 100, 50, 40};
constexpr ImageSize kImage{80, 100};

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
  const Rectangle outline = whole_outline(car_at(0, 12), kRoadCamera);
  EXPECT_NEAR(outline.left, 40.5, 1e-9);
  EXPECT_NEAR(outline.right, 60.5, 1e-9);
  EXPECT_NEAR(outline.bottom, 40.5 + 150 / 10.46, 1e-9);
  EXPECT_EQ(visible_outline(car_at(0, 12), kRoadCamera, kImage), outline);
}

TEST(VehicleOutline, EndsAtTheImagesBorderAndBehindTheCameraIsEmpty) {
  const VehicleShape car = car_at(7, 12);
  const Rectangle whole = whole_outline(car, kRoadCamera);
  const Rectangle seen = visible_outline(car, kRoadCamera, kImage);
  EXPECT_NEAR(whole.left, 50.5 + 100 * 6 / 14.0, 1e-9) << "the far end is nearest to the middle";
  EXPECT_NEAR(whole.right, 50.5 + 100 * 8 / 10.0, 1e-9);
  EXPECT_NEAR(seen.left, whole.left, 1e-9);
  EXPECT_NEAR(seen.right, 100, 1e-9);
  EXPECT_LT(seen.bottom, whole.bottom) << "the lowest point lies outside";
  const Rectangle outline = whole_outline(car_at(0, -10), kRoadCamera);
  EXPECT_GT(outline.left, outline.right);
}

TEST(VehicleOutline, AVehicleBesideTheCameraIsCutBeforeIt) {
  // Its inner side is at x = -3, its far end at z = 5: u = 50 - 60, outside the image.
  const Rectangle beside = visible_outline(car_at(-4, 3), kRoadCamera, kImage);
  EXPECT_GT(beside.left, beside.right);
  const Rectangle nearer = visible_outline(car_at(-3, 5), kRoadCamera, kImage);
  // Inner side at x = -2, far end at z = 7; its near end is behind the border.
  EXPECT_EQ(nearer.left, 0);
  EXPECT_NEAR(nearer.right, 50.5 - 200 / 7.0, 1e-9);
}

std::map<int, Vehicle> by_number(std::uint64_t seed, int frame) {
  std::map<int, Vehicle> found;
  for (const Vehicle& vehicle : traffic(seed, frame)) found[vehicle.number] = vehicle;
  return found;
}

TEST(RoadTraffic, ParkedVehiclesComeNearerAtTheCamerasSpeed) {
  const auto before = by_number(7, 10);
  const auto after = by_number(7, 11);
  int parked = 0;
  for (const auto& [number, vehicle] : before) {
    if (std::abs(vehicle.location.x) < 6 || !after.contains(number)) continue;
    ++parked;
    EXPECT_NEAR(vehicle.location.z - after.at(number).location.z, kCameraSpeed * kFrameSeconds,
                1e-9);
  }
  EXPECT_GE(parked, 4);
}

TEST(RoadTraffic, OncomingOnesAreFasterAndTheOneAheadKeepsItsDistance) {
  const auto before = by_number(7, 10);
  const auto after = by_number(7, 11);
  EXPECT_LT(std::abs(before.at(0).location.z - after.at(0).location.z), 0.2);
  EXPECT_GT(before.at(2).location.z - after.at(2).location.z, 1.0);
}

TEST(RoadTraffic, LooksStayTheSameAndEveryVehicleStandsOnTheRoad) {
  const Vehicle early = by_number(7, 0).at(0);
  const Vehicle late = by_number(7, 30).at(0);
  EXPECT_EQ(early.type, late.type);
  EXPECT_EQ(early.length, late.length);
  EXPECT_NE(early.length, by_number(8, 0).at(0).length);
  for (const Vehicle& vehicle : traffic(1, 5)) {
    EXPECT_EQ(vehicle.location.y, kCameraHeight);
    EXPECT_GT(vehicle.height, 1.3);
    EXPECT_TRUE(vehicle.type == "Car" || vehicle.type == "Van");
  }
}

/// The labelled frames of the demo dataset lie among these.
constexpr int kFrames[] = {3, 9, 17, 25};

/// Around the centres of the pixels that show the object, as edges.
Rectangle seen_box(const std::vector<int>& objects, ImageSize size, int number) {
  Rectangle box{1e9, 1e9, -1e9, -1e9};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (objects[static_cast<std::size_t>(y) * size.width + x] != number) continue;
      box = {std::min(box.left, double(x)), std::min(box.top, double(y)),
             std::max(box.right, x + 1.0), std::max(box.bottom, y + 1.0)};
    }
  }
  return box;
}

TEST(RoadScene, BoxesFitThePixelsWithinOne) {
  const RoadScene scene(7);
  int compared = 0;
  for (const int frame : kFrames) {
    const auto objects = scene.objects(frame);
    for (const RoadLabel& label : scene.labels(frame)) {
      if (label.occlusion != 0 || label.dont_care) continue;
      // Even a few covered pixels may be the outermost ones.
      const auto labels = scene.labels(frame);
      const bool touched = std::any_of(labels.begin(), labels.end(), [&](const RoadLabel& other) {
        return other.vehicle.number != label.vehicle.number &&
               other.vehicle.location.z < label.vehicle.location.z &&
               other.outline.left < label.box.right && other.outline.right > label.box.left;
      });
      if (touched) continue;
      const Rectangle seen = seen_box(objects, scene.size(), label.vehicle.number);
      EXPECT_NEAR(seen.left, label.box.left, 1) << frame << " " << label.vehicle.number;
      EXPECT_NEAR(seen.top, label.box.top, 1);
      EXPECT_NEAR(seen.right, label.box.right, 1);
      EXPECT_NEAR(seen.bottom, label.box.bottom, 1);
      ++compared;
    }
  }
  EXPECT_GE(compared, 12);
}

TEST(RoadScene, NoPixelOfAVehicleLiesOutsideItsOutline) {
  const RoadScene scene(11);
  const auto objects = scene.objects(9);
  for (const RoadLabel& label : scene.labels(9)) {
    const Rectangle seen = seen_box(objects, scene.size(), label.vehicle.number);
    if (seen.left > seen.right) continue;  // hidden after all
    EXPECT_GE(seen.left, label.box.left - 1);
    EXPECT_GE(seen.top, label.box.top - 1);
    EXPECT_LE(seen.right, label.box.right + 1);
    EXPECT_LE(seen.bottom, label.box.bottom + 1);
  }
}

TEST(RoadScene, TheSceneHasWhatTheDemoShows) {
  for (const std::uint64_t seed : {1, 7, 99}) {
    const RoadScene scene(seed);
    std::set<int> described;
    int truncated = 0, dont_care = 0, occluded = 0;
    for (const int frame : kFrames) {
      const auto labels = scene.labels(frame);
      EXPECT_GE(std::count_if(labels.begin(), labels.end(),
                              [](const RoadLabel& label) { return !label.dont_care; }),
                3);
      for (const RoadLabel& label : labels) {
        truncated += label.truncation > 0.05;
        dont_care += label.dont_care;
        occluded += label.occlusion > 0;
        if (!label.dont_care) described.insert(label.vehicle.number);
      }
    }
    EXPECT_GE(described.size(), 5u);
    EXPECT_GE(truncated, 1);
    EXPECT_GE(dont_care, 1);
    EXPECT_GE(occluded, 1);
  }
}

TEST(RoadScene, BoxesLieInTheImageAndMatchTheirOutlines) {
  const RoadScene scene(7);
  for (const int frame : kFrames) {
    for (const RoadLabel& label : scene.labels(frame)) {
      EXPECT_GE(label.box.left, 0);
      EXPECT_GE(label.box.top, 0);
      EXPECT_LE(label.box.right, scene.size().width);
      EXPECT_LE(label.box.bottom, scene.size().height);
      EXPECT_GE(label.truncation, 0);
      EXPECT_LE(label.truncation, 1);
      const bool whole = label.box == label.outline;
      EXPECT_EQ(label.truncation < 1e-12, whole);
    }
  }
}

TEST(RoadScene, TheProjectedBlockOfThe3dLabelHoldsTheOutline) {
  const RoadScene scene(7);
  int compared = 0;
  for (const RoadLabel& label : scene.labels(9)) {
    const Vehicle& car = label.vehicle;
    if (car.location.z < car.length) continue;  // reaches behind the camera
    // KITTI's devkit: corners in the object's frame, turned about y, moved to the location.
    Rectangle block{1e9, 1e9, -1e9, -1e9};
    for (int corner = 0; corner < 8; ++corner) {
      const double x = (corner & 1 ? 0.5 : -0.5) * car.length;
      const double y = corner & 2 ? -car.height : 0;
      const double z = (corner & 4 ? 0.5 : -0.5) * car.width;
      const double c = std::cos(car.rotation_y), s = std::sin(car.rotation_y);
      const Point at =
          project(scene.camera(), car.location + Vector3{c * x + s * z, y, -s * x + c * z});
      block = {std::min(block.left, at.x + 0.5), std::min(block.top, at.y + 0.5),
               std::max(block.right, at.x + 0.5), std::max(block.bottom, at.y + 0.5)};
    }
    EXPECT_LE(block.left, label.outline.left + 1e-9);
    EXPECT_LE(block.top, label.outline.top + 1e-9);
    EXPECT_GE(block.right, label.outline.right - 1e-9);
    EXPECT_GE(block.bottom, label.outline.bottom - 1e-9);
    // The shape is hollowed a little at the corners, no more.
    EXPECT_LT(block.right - block.left, 1.25 * (label.outline.right - label.outline.left));
    ++compared;
  }
  EXPECT_GE(compared, 4);
}

TEST(RoadScene, ObservationAngleIsKittis) {
  const RoadScene scene(7);
  for (const RoadLabel& label : scene.labels(9)) {
    const Vehicle& car = label.vehicle;
    const double difference =
        label.alpha - (car.rotation_y - std::atan2(car.location.x, car.location.z));
    EXPECT_NEAR(std::remainder(difference, 2 * std::numbers::pi), 0, 1e-9);
    EXPECT_LE(std::abs(label.alpha), std::numbers::pi);
  }
}

TEST(RoadScene, EverythingMovesAndNothingIsRandom) {
  const RoadScene scene(7);
  const Image before = scene.render(9);
  EXPECT_EQ(before, RoadScene(7).render(9));
  const Image after = scene.render(10);
  std::size_t changed_road = 0;
  const std::size_t half = before.bgr.size() / 2;
  for (std::size_t i = half; i < before.bgr.size(); ++i)
    changed_road += before.bgr[i] != after.bgr[i];
  EXPECT_GT(changed_road, (before.bgr.size() - half) / 4) << "the road has a texture that moves";
  EXPECT_NE(before, RoadScene(8).render(9));
}

}  // namespace
}  // namespace eventgan
