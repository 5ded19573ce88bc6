#include "stages/synthetic/scenes/vehicle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "stages/synthetic/scenes/camera.h"

namespace eventgan {
namespace {

struct Crossing {
  double near = -std::numeric_limits<double>::infinity();
  double far = std::numeric_limits<double>::infinity();
  int axis = 0;  ///< of the face where the ray enters: 0 front or back, 1 top, 2 side
};

void cut(Crossing& crossing, int axis, double origin, double direction, double low, double high) {
  double first = (low - origin) / direction;
  double second = (high - origin) / direction;
  if (first > second) std::swap(first, second);
  if (first > crossing.near) {
    crossing.near = first;
    crossing.axis = axis;
  }
  crossing.far = std::min(crossing.far, second);
}

std::optional<Crossing> cross(const Vector3& low, const Vector3& high, const Vector3& origin,
                              const Vector3& direction) {
  Crossing crossing;
  cut(crossing, 0, origin.x, direction.x, low.x, high.x);
  cut(crossing, 1, origin.y, direction.y, low.y, high.y);
  cut(crossing, 2, origin.z, direction.z, low.z, high.z);
  // The negation refuses NaN, which 0/0 gives for a ray in a face's plane.
  if (!(crossing.near < crossing.far) || crossing.near <= 0) return std::nullopt;
  return crossing;
}

Colour wheel_colour(const Vector3& low, const Vector3& high, const Vector3& at) {
  const double x = at.x - (low.x + high.x) / 2;
  const double y = at.y - (low.y + high.y) / 2;
  const bool hub = std::hypot(x, y) < 0.3 * (high.x - low.x);
  return hub ? Colour{150, 150, 150} : Colour{28, 28, 30};
}

}  // namespace

VehicleShape::VehicleShape(const Vehicle& vehicle)
    : vehicle_(vehicle),
      cosine_(std::cos(vehicle.rotation_y)),
      sine_(std::sin(vehicle.rotation_y)),
      eye_(to_own(vehicle.location * -1)),
      blocks_(blocks_of(vehicle)),
      texture_(CounterRandom(static_cast<std::uint64_t>(vehicle.number))) {}

std::array<VehicleShape::Block, 6> VehicleShape::blocks_of(const Vehicle& vehicle) {
  const double l = vehicle.length / 2;
  const double h = vehicle.height;
  const double w = vehicle.width / 2;
  const double wheel = 0.2 * h;  // radius
  const double waist = vehicle.type == "Van" ? 0.5 : 0.58;
  const double tail = vehicle.type == "Van" ? -0.98 : -0.72;
  const auto wheel_at = [&](double x, double z) {
    return Block{Part::kWheel, {x - wheel, -2 * wheel, z - 0.12 * w}, {x + wheel, 0, z + 0.12 * w}};
  };
  return {{{Part::kBody, {-l, -waist * h, -w}, {l, -0.18 * h, w}},
           {Part::kCabin, {tail * l, -h, -0.88 * w}, {0.45 * l, -waist * h, 0.88 * w}},
           wheel_at(0.62 * l, 0.88 * w),
           wheel_at(0.62 * l, -0.88 * w),
           wheel_at(-0.62 * l, 0.88 * w),
           wheel_at(-0.62 * l, -0.88 * w)}};
}

// KITTI's rotation about y takes the direction x to (cos, 0, -sin).
Vector3 VehicleShape::to_own(const Vector3& v) const {
  return {cosine_ * v.x - sine_ * v.z, v.y, sine_ * v.x + cosine_ * v.z};
}

Vector3 VehicleShape::to_camera(const Vector3& v) const {
  return {cosine_ * v.x + sine_ * v.z, v.y, -sine_ * v.x + cosine_ * v.z};
}

Colour VehicleShape::body_colour(const Vector3& at, int axis, float grain) const {
  const double from_roof = -at.y / vehicle_.height;  // 0 at the ground, 1 at the roof
  const double across = std::abs(at.z) / (vehicle_.width / 2);
  if (axis == 0 && from_roof > 0.36 && from_roof < 0.5 && across > 0.6) {
    return at.x > 0 ? Colour{235, 245, 250} : Colour{30, 30, 210};  // head and tail lights
  }
  if (axis == 0 && from_roof < 0.34 && across < 0.3) return {200, 205, 205};  // number plate
  if (from_roof < 0.26) return {45, 45, 48};                                  // bumper and sill
  if (axis == 2 && std::abs(std::abs(at.x) - 0.12 * vehicle_.length) < 0.03) return {50, 50, 50};
  return vehicle_.paint * (0.75f + 0.4f * grain);
}

Colour VehicleShape::cabin_colour(const Vector3& at, int axis, float grain) const {
  const double from_roof = -at.y / vehicle_.height;
  if (axis == 1 || from_roof > 0.93) return vehicle_.paint * (0.85f + 0.3f * grain);
  const double pillar = std::fmod(std::abs(at.x) + 0.4, 1.1);
  if (axis == 2 && pillar < 0.12) return vehicle_.paint * 0.8f;
  return Colour{80, 66, 52} * (0.55f + 0.9f * grain);  // glass with reflections
}

Colour VehicleShape::colour_at(const Block& block, const Vector3& at, int axis) const {
  const double along = axis == 0 ? at.z : at.x;
  const double up = axis == 1 ? at.z : at.y;
  const float grain = texture_.noise(along / 0.35, up / 0.25);
  const float light = axis == 1 ? 1.05f : axis == 2 ? 0.9f : 0.8f;
  switch (block.part) {
    case Part::kBody:
      return body_colour(at, axis, grain) * light;
    case Part::kCabin:
      return cabin_colour(at, axis, grain) * light;
    case Part::kWheel:
      break;
  }
  return wheel_colour(block.low, block.high, at) * light;
}

std::optional<VehicleHit> VehicleShape::hit(const Vector3& direction) const {
  const Vector3 own = to_own(direction);
  const Block* struck = nullptr;
  Crossing first;
  for (const Block& block : blocks_) {
    const auto crossing = cross(block.low, block.high, eye_, own);
    if (!crossing || (struck != nullptr && first.near <= crossing->near)) continue;
    first = *crossing;
    struck = &block;
  }
  if (struck == nullptr) return std::nullopt;
  return VehicleHit{first.near, colour_at(*struck, eye_ + own * first.near, first.axis)};
}

std::vector<std::array<Vector3, 4>> VehicleShape::faces() const {
  std::vector<std::array<Vector3, 4>> faces;
  for (const Block& block : blocks_) {
    // The bits 1, 2, 4 of a corner's number choose the far end in length, height and width.
    const auto corner = [&](int bits) {
      const Vector3 own{(bits & 1) ? block.high.x : block.low.x,
                        (bits & 2) ? block.high.y : block.low.y,
                        (bits & 4) ? block.high.z : block.low.z};
      return vehicle_.location + to_camera(own);
    };
    for (const int axis : {1, 2, 4}) {
      const int across = axis == 1 ? 2 : 1;
      const int up = 7 - axis - across;
      for (const int end : {0, axis}) {
        faces.push_back(
            {corner(end), corner(end | across), corner(end | across | up), corner(end | up)});
      }
    }
  }
  return faces;
}

bool VehicleShape::shades(const Vector3& ground) const {
  const Vector3 own = to_own(ground - vehicle_.location);
  return std::abs(own.x) < vehicle_.length / 2 + kShade &&
         std::abs(own.z) < vehicle_.width / 2 + kShade;
}

namespace {

constexpr double kNear = 0.2;  // m; nothing nearer is seen

/// The half space of points p with normal . p >= offset.
struct HalfSpace {
  Vector3 normal;
  double offset = 0;

  double inside(const Vector3& point) const { return dot(normal, point) - offset; }
};

using Polygon = std::vector<Vector3>;

/// The part of a polygon within a half space (Sutherland and Hodgman 1974).
Polygon cut(const Polygon& polygon, const HalfSpace& space) {
  Polygon result;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector3& from = polygon[i];
    const Vector3& to = polygon[(i + 1) % polygon.size()];
    const double before = space.inside(from);
    const double after = space.inside(to);
    if (before >= 0) result.push_back(from);
    if ((before >= 0) != (after >= 0)) {
      result.push_back(from + (to - from) * (before / (before - after)));
    }
  }
  return result;
}

/// Around the projections of the faces, each cut by all half spaces. A ray that meets a solid
/// enters through a face, so that the faces cover the solid's image.
Rectangle bounds_within(const VehicleShape& shape, const Intrinsics& camera,
                        const std::vector<HalfSpace>& spaces) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Rectangle bounds{kFar, kFar, -kFar, -kFar};
  for (const auto& face : shape.faces()) {
    Polygon polygon(face.begin(), face.end());
    for (const HalfSpace& space : spaces) polygon = cut(polygon, space);
    for (const Vector3& corner : polygon) {
      // Centres of pixels are whole numbers in a projection, edges between pixels are in a box.
      const Point at = project(camera, corner);
      bounds = {std::min(bounds.left, at.x + 0.5), std::min(bounds.top, at.y + 0.5),
                std::max(bounds.right, at.x + 0.5), std::max(bounds.bottom, at.y + 0.5)};
    }
  }
  return bounds;
}

}  // namespace

Rectangle whole_outline(const VehicleShape& shape, const Intrinsics& camera) {
  return bounds_within(shape, camera, {{{0, 0, 1}, kNear}});
}

Rectangle visible_outline(const VehicleShape& shape, const Intrinsics& camera, ImageSize image) {
  // u >= -0.5 where u = f_x x / z + c_x, so f_x x + (c_x + 0.5) z >= 0; the other sides likewise.
  const Intrinsics& c = camera;
  Rectangle seen = bounds_within(shape, camera,
                                 {{{0, 0, 1}, kNear},
                                  {{c.focal_x, 0, c.centre_x + 0.5}, 0},
                                  {{-c.focal_x, 0, image.width - 0.5 - c.centre_x}, 0},
                                  {{0, c.focal_y, c.centre_y + 0.5}, 0},
                                  {{0, -c.focal_y, image.height - 0.5 - c.centre_y}, 0}});
  // What was cut at the border may lie beyond it by a rounding.
  seen.left = std::max(seen.left, 0.0);
  seen.top = std::max(seen.top, 0.0);
  seen.right = std::min(seen.right, static_cast<double>(image.width));
  seen.bottom = std::min(seen.bottom, static_cast<double>(image.height));
  return seen;
}

}  // namespace eventgan
