#include "stages/scenes/road/vehicle_outline.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "stages/scenes/camera.h"

namespace eventgan {
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
/// enters through a face, so that the faces cover the solid's picture.
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

Rectangle visible_outline(const VehicleShape& shape, const Intrinsics& camera, ImageSize picture) {
  // u >= -0.5 where u = f_x x / z + c_x, so f_x x + (c_x + 0.5) z >= 0; the other sides likewise.
  const Intrinsics& c = camera;
  Rectangle seen = bounds_within(shape, camera,
                                 {{{0, 0, 1}, kNear},
                                  {{c.focal_x, 0, c.centre_x + 0.5}, 0},
                                  {{-c.focal_x, 0, picture.width - 0.5 - c.centre_x}, 0},
                                  {{0, c.focal_y, c.centre_y + 0.5}, 0},
                                  {{0, -c.focal_y, picture.height - 0.5 - c.centre_y}, 0}});
  // What was cut at the border may lie beyond it by a rounding.
  seen.left = std::max(seen.left, 0.0);
  seen.top = std::max(seen.top, 0.0);
  seen.right = std::min(seen.right, static_cast<double>(picture.width));
  seen.bottom = std::min(seen.bottom, static_cast<double>(picture.height));
  return seen;
}

}  // namespace eventgan
