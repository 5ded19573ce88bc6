#include <algorithm>
#include <cmath>
#include <numbers>

#include "stages/scenes/road/road_scene.h"
#include "stages/scenes/road/road_traffic.h"
#include "stages/scenes/road/vehicle_outline.h"

namespace eventgan {
namespace {

double area(const Rectangle& box) {
  return std::max(0.0, box.right - box.left) * std::max(0.0, box.bottom - box.top);
}

Rectangle overlap(const Rectangle& a, const Rectangle& b) {
  return {std::max(a.left, b.left), std::max(a.top, b.top), std::min(a.right, b.right),
          std::min(a.bottom, b.bottom)};
}

double observation_angle(const Vehicle& vehicle) {
  const double angle = vehicle.rotation_y - std::atan2(vehicle.location.x, vehicle.location.z);
  return std::remainder(angle, 2 * std::numbers::pi);
}

/// True if a nearer outline covers the whole box: the vehicle behind it is as good as unseen.
bool is_hidden(const Rectangle& box, const std::vector<RoadLabel>& nearer) {
  return std::any_of(nearer.begin(), nearer.end(), [&](const RoadLabel& label) {
    return area(overlap(box, label.outline)) >= 0.99 * area(box);
  });
}

int occlusion_of(const Rectangle& box, const std::vector<RoadLabel>& nearer) {
  double covered = 0;
  for (const RoadLabel& label : nearer) covered += area(overlap(box, label.outline));
  const double share = covered / area(box);
  return share < 0.05 ? 0 : share < 0.5 ? 1 : 2;
}

}  // namespace

std::vector<RoadLabel> RoadScene::in_view(int frame) const {
  std::vector<Vehicle> vehicles = traffic(seed_, frame);
  std::sort(vehicles.begin(), vehicles.end(), [](const Vehicle& a, const Vehicle& b) {
    return a.location.z != b.location.z ? a.location.z < b.location.z : a.number < b.number;
  });
  std::vector<RoadLabel> seen;
  for (const Vehicle& vehicle : vehicles) {
    RoadLabel label;
    label.vehicle = vehicle;
    const VehicleShape shape(vehicle);
    label.outline = whole_outline(shape, camera());
    label.box = visible_outline(shape, camera(), size());
    if (area(label.box) <= 0) continue;
    label.truncation = std::clamp(1 - area(label.box) / area(label.outline), 0.0, 1.0);
    label.occlusion = occlusion_of(label.box, seen);
    label.alpha = observation_angle(vehicle);
    label.dont_care = vehicle.location.z > kDontCareDistance;
    seen.push_back(label);
  }
  return seen;
}

std::vector<RoadLabel> RoadScene::labels(int frame) const {
  std::vector<RoadLabel> labels;
  std::vector<RoadLabel> nearer;
  for (const RoadLabel& label : in_view(frame)) {
    const Rectangle& box = label.box;
    const bool large = box.right - box.left >= 2 && box.bottom - box.top >= 2;
    if (large && !is_hidden(box, nearer)) labels.push_back(label);
    nearer.push_back(label);
  }
  return labels;
}

}  // namespace eventgan
