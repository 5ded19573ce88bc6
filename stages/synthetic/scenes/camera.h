#pragma once

#include <cmath>

#include "manifests/values/labels.h"

namespace eventgan {

/// A point or direction in a camera's frame: x right, y down, z forward.
struct Vector3 {
  double x = 0;
  double y = 0;
  double z = 0;

  Vector3 operator+(const Vector3& other) const { return {x + other.x, y + other.y, z + other.z}; }
  Vector3 operator-(const Vector3& other) const { return {x - other.x, y - other.y, z - other.z}; }
  Vector3 operator*(double factor) const { return {x * factor, y * factor, z * factor}; }
};

inline double dot(const Vector3& a, const Vector3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline double length(const Vector3& v) { return std::sqrt(dot(v, v)); }

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
