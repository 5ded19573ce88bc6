#pragma once

#include <cstdint>
#include <vector>

#include "manifests/values/labels.h"
#include "stages/synthetic/scenes/camera.h"
#include "stages/synthetic/scenes/image.h"
#include "stages/synthetic/scenes/vehicle.h"

namespace eventgan {

inline constexpr double kFrameSeconds = 0.1;   ///< KITTI's 10 frames a second
inline constexpr double kCameraHeight = 1.65;  ///< above the road, m
inline constexpr double kCameraSpeed = 6.0;    ///< forward, m/s

/// All vehicles ahead of the camera at a frame: one ahead in the same lane, one being overtaken on
/// the right, oncoming ones on the left and parked ones on both sides. A pure function of seed and
/// frame.
std::vector<Vehicle> traffic(std::uint64_t seed, double frame);

/// Where a ray ends that meets no vehicle.
struct Background {
  Colour colour;
  double distance = 0;  ///< in units of the ray's direction; infinite for the sky
  bool is_road = false;
};

/// A street between two rows of houses, drawn from a camera that moves along it.
class RoadSurroundings {
 public:
  /// focal_px: the camera's focal length, by which far patterns are faded before they flicker.
  RoadSurroundings(std::uint64_t seed, double focal_px);

  /// What the ray from the camera meets; `travelled` is the camera's way along the street in m.
  Background look(const Vector3& direction, double travelled) const;

 private:
  Colour ground(double x, double z, double travelled) const;
  Colour wall(double side, double y, double z, double travelled) const;
  Colour sky(const Vector3& direction) const;

  Texture texture_;
  double focal_px_;
};

/// A vehicle as it appears in the image.
struct RoadLabel {
  Vehicle vehicle;
  Rectangle outline;       ///< around the whole vehicle, edges in px, may pass the image's border
  Rectangle box;           ///< around what the image shows of it, were nothing before it
  double truncation = 0;   ///< share of `outline` outside `box`
  int occlusion = 0;       ///< by nearer outlines: 0 under 5 % of the box covered, 1 under half, 2
  double alpha = 0;        ///< KITTI's observation angle, rad in [-π, π]
  bool dont_care = false;  ///< farther than kDontCareDistance: marked, but not described
};

inline constexpr double kDontCareDistance = 45;  ///< m

/// A drive through a street with traffic, seen by a camera like KITTI's at half its resolution.
/// Every image and label is a pure function of seed and frame, which lasts kFrameSeconds and may
/// be any moment between two whole ones.
class RoadScene {
 public:
  explicit RoadScene(std::uint64_t seed);

  ImageSize size() const { return {188, 621}; }
  Intrinsics camera() const { return {360.0, 360.0, 305.0, 88.0}; }

  Image render(double frame) const;

  /// [y, x]: the Vehicle::number seen at each pixel's centre, -1 for the surroundings.
  std::vector<int> objects(double frame) const;

  /// The vehicles whose outline reaches at least two pixels into the image and that no nearer one
  /// covers wholly, nearest first.
  std::vector<RoadLabel> labels(double frame) const;

 private:
  /// Every vehicle of which any part may be in the image, nearest first.
  std::vector<RoadLabel> in_view(double frame) const;

  std::uint64_t seed_;
  RoadSurroundings surroundings_;
};

}  // namespace eventgan
