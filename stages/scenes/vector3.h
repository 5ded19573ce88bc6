#pragma once

#include <cmath>

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

}  // namespace eventgan
