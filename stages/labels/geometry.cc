#include "stages/labels/geometry.h"

#include <algorithm>

namespace eventgan {
namespace {

/// One axis of the map: an edge at 0 lies at `offset` in the volume.
struct Axis {
  double scale;
  double offset;

  double edge_to_volume(double x) const { return x * scale + offset; }
  double edge_to_source(double x) const { return (x - offset) / scale; }
  // A pixel's centre lies half a pixel after its left edge.
  double point_to_volume(double x) const { return edge_to_volume(x + 0.5) - 0.5; }
  double point_to_source(double x) const { return edge_to_source(x + 0.5) - 0.5; }
};

Axis horizontal(const Placement& placement) {
  return {placement.scale_x(), static_cast<double>(placement.offset_x)};
}

Axis vertical(const Placement& placement) {
  return {placement.scale_y(), static_cast<double>(placement.offset_y)};
}

}  // namespace

Point to_volume(const Placement& placement, Point point) {
  return {horizontal(placement).point_to_volume(point.x),
          vertical(placement).point_to_volume(point.y)};
}

Point to_source(const Placement& placement, Point point) {
  return {horizontal(placement).point_to_source(point.x),
          vertical(placement).point_to_source(point.y)};
}

Rectangle to_volume(const Placement& placement, const Rectangle& box) {
  const Axis x = horizontal(placement);
  const Axis y = vertical(placement);
  return {x.edge_to_volume(box.left), y.edge_to_volume(box.top), x.edge_to_volume(box.right),
          y.edge_to_volume(box.bottom)};
}

Rectangle to_source(const Placement& placement, const Rectangle& box) {
  const Axis x = horizontal(placement);
  const Axis y = vertical(placement);
  return {x.edge_to_source(box.left), y.edge_to_source(box.top), x.edge_to_source(box.right),
          y.edge_to_source(box.bottom)};
}

Intrinsics to_volume(const Placement& placement, const Intrinsics& camera) {
  const Axis x = horizontal(placement);
  const Axis y = vertical(placement);
  return {camera.focal_x * x.scale, camera.focal_y * y.scale, x.point_to_volume(camera.centre_x),
          y.point_to_volume(camera.centre_y)};
}

Rectangle clip(const Rectangle& box, ImageSize size) {
  const auto into = [](double x, int extent) {
    return std::clamp(x, 0.0, static_cast<double>(extent));
  };
  return {into(box.left, size.width), into(box.top, size.height), into(box.right, size.width),
          into(box.bottom, size.height)};
}

bool is_empty(const Rectangle& box) { return !(box.left < box.right && box.top < box.bottom); }

}  // namespace eventgan
