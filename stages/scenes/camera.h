#pragma once

#include "manifests/labels.h"
#include "stages/scenes/vector3.h"

namespace eventgan {

/// Where a point of the camera's frame appears: u = f_x X/Z + c_x, v = f_y Y/Z + c_y; Z > 0.
inline Point project(const Intrinsics& camera, const Vector3& point) {
  return {camera.focal_x * point.x / point.z + camera.centre_x,
          camera.focal_y * point.y / point.z + camera.centre_y};
}

/// The direction, with z = 1, in which the pixel position lies.
inline Vector3 ray(const Intrinsics& camera, double u, double v) {
  return {(u - camera.centre_x) / camera.focal_x, (v - camera.centre_y) / camera.focal_y, 1};
}

}  // namespace eventgan
