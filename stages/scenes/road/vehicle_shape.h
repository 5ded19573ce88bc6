#pragma once

#include <array>
#include <optional>
#include <vector>

#include "stages/scenes/road/vehicle.h"
#include "stages/scenes/texture.h"

namespace eventgan {

/// Where a ray meets a vehicle.
struct VehicleHit {
  double distance = 0;  ///< in units of the ray's direction
  Colour colour;
};

/// A vehicle's solid form: a few blocks, each a convex part.
class VehicleShape {
 public:
  explicit VehicleShape(const Vehicle& vehicle);

  /// The nearest point of the vehicle on the ray from the camera, if any.
  std::optional<VehicleHit> hit(const Vector3& direction) const;

  /// The faces of the blocks, corners in order around each, in the camera's frame.
  std::vector<std::array<Vector3, 4>> faces() const;

  /// True if the ground point lies in the shade under the vehicle, which is kShade m wider.
  bool shades(const Vector3& ground) const;
  static constexpr double kShade = 0.2;

 private:
  enum class Part { kBody, kCabin, kWheel };

  /// An upright block in the vehicle's own frame: x forward, y down, z to its right, from
  /// `location`.
  struct Block {
    Part part;
    Vector3 low;
    Vector3 high;
  };

  static std::array<Block, 6> blocks_of(const Vehicle& vehicle);
  Vector3 to_own(const Vector3& direction) const;
  Vector3 to_camera(const Vector3& direction) const;
  Colour colour_at(const Block& block, const Vector3& at, int axis) const;
  Colour body_colour(const Vector3& at, int axis, float grain) const;
  Colour cabin_colour(const Vector3& at, int axis, float grain) const;

  Vehicle vehicle_;
  double cosine_;
  double sine_;
  Vector3 eye_;  ///< the camera in the vehicle's own frame
  std::array<Block, 6> blocks_;
  Texture texture_;
};

}  // namespace eventgan
