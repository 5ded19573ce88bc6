#pragma once

#include <cstdint>

#include "stages/scenes/picture.h"
#include "stages/scenes/texture.h"
#include "stages/scenes/vector3.h"

namespace eventgan {

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

}  // namespace eventgan
