#include "stages/scenes/layouts/kitti_text.h"

#include <fmt/core.h>

namespace eventgan {
namespace {

std::string label_line(const RoadLabel& label) {
  const Rectangle& box = label.box;
  const Vehicle& vehicle = label.vehicle;
  if (label.dont_care) {
    return fmt::format(
        "DontCare -1 -1 -10 {:.2f} {:.2f} {:.2f} {:.2f} -1 -1 -1 -1000 -1000 -1000 -10\n", box.left,
        box.top, box.right, box.bottom);
  }
  return fmt::format(
      "{} {:.2f} {} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} {:.2f} "
      "{:.2f}\n",
      vehicle.type, label.truncation, label.occlusion, label.alpha, box.left, box.top, box.right,
      box.bottom, vehicle.height, vehicle.width, vehicle.length, vehicle.location.x,
      vehicle.location.y, vehicle.location.z, vehicle.rotation_y);
}

}  // namespace

std::string kitti_labels(const std::vector<RoadLabel>& labels) {
  std::string text;
  for (const RoadLabel& label : labels) text += label_line(label);
  return text;
}

std::string kitti_calibration(const Intrinsics& camera) {
  std::string text;
  for (const char* name : {"P0", "P1", "P2", "P3"}) {
    text += fmt::format("{}: {:.12e} 0 {:.12e} 0 0 {:.12e} {:.12e} 0 0 0 1 0\n", name,
                        camera.focal_x, camera.centre_x, camera.focal_y, camera.centre_y);
  }
  text += "R0_rect: 1 0 0 0 1 0 0 0 1\n";
  // The laser scanner's x is ahead and its z up; the inertial sensor stands in the same place.
  text += "Tr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n";
  return text + "Tr_imu_to_velo: 1 0 0 0 0 1 0 0 0 0 1 0\n";
}

}  // namespace eventgan
