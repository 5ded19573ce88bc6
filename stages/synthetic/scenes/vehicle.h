#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/synthetic/scenes/camera.h"
#include "stages/synthetic/scenes/image.h"

namespace eventgan {

/// A car or van on the road at one moment, as KITTI describes objects: metres, camera frame.
struct Vehicle {
  std::string type;  ///< KITTI's class
  int number = 0;    ///< the same for this vehicle at all times
  double height = 0;
  double width = 0;
  double length = 0;
  Vector3 location;       ///< middle of its underside
  double rotation_y = 0;  ///< 0: its front points along x; -π/2: along z, away from the camera
  Colour paint;
};

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

/// Around all of a vehicle that lies before the camera, as edges in px; may pass the image's
/// border, and is empty (left > right) for a vehicle behind the camera.
Rectangle whole_outline(const VehicleShape& shape, const Intrinsics& camera);

/// Around what an image of this size shows of the vehicle, were nothing before it: exact also at
/// the image's border, where it may be smaller than the part of the whole outline that lies
/// within.
Rectangle visible_outline(const VehicleShape& shape, const Intrinsics& camera, ImageSize image);

}  // namespace eventgan
