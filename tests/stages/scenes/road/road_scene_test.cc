#include "stages/scenes/road/road_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "stages/scenes/camera.h"

namespace eventgan {
namespace {

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

TEST(RoadScene, BoxesLieInThePictureAndMatchTheirOutlines) {
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
  const Picture before = scene.picture(9);
  EXPECT_EQ(before, RoadScene(7).picture(9));
  const Picture after = scene.picture(10);
  std::size_t changed_road = 0;
  const std::size_t half = before.bgr.size() / 2;
  for (std::size_t i = half; i < before.bgr.size(); ++i)
    changed_road += before.bgr[i] != after.bgr[i];
  EXPECT_GT(changed_road, (before.bgr.size() - half) / 4) << "the road has a texture that moves";
  EXPECT_NE(before, RoadScene(8).picture(9));
}

}  // namespace
}  // namespace eventgan
