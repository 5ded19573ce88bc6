#include "stages/frames/kitti/tracklet_box.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "stages/frames/kitti/kitti_label.h"

namespace eventgan {
namespace {

/// What is nearer than this to the camera's plane is not seen; keeps the projection finite.
constexpr double kNearest_m = 0.1;

/// The cuboid's corners in the rectified frame. Corner i is at the far end of the length, width and
/// height where bit 0, 1 and 2 of i is set.
std::array<Point3, 8> corners(const TrackletPose& pose, const RawCalibration& calibration) {
  const double cosine = std::cos(pose.rotation_z);
  const double sine = std::sin(pose.rotation_z);
  std::array<Point3, 8> corners{};
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const double along = pose.length * ((i & 1) ? 0.5 : -0.5);
    const double across = pose.width * ((i & 2) ? 0.5 : -0.5);
    const double up = (i & 4) ? pose.height : 0;
    corners[i] = calibration.to_rectified({pose.x + cosine * along - sine * across,
                                           pose.y + sine * along + cosine * across, pose.z + up});
  }
  return corners;
}

/// Grows around projected points.
struct Hull {
  Rectangle box{std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                -std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};

  void add(Point point) {
    box = {std::min(box.left, point.x), std::min(box.top, point.y), std::max(box.right, point.x),
           std::max(box.bottom, point.y)};
  }
};

/// The part of the edge from `a` to `b` before the camera, projected: leaving out corners behind
/// the camera alone would cut a near object short.
void add_edge(const Point3& a, const Point3& b, const RawCalibration& calibration, Hull& hull) {
  if (a[2] >= kNearest_m) hull.add(calibration.project(a));
  if (b[2] >= kNearest_m) hull.add(calibration.project(b));
  if ((a[2] >= kNearest_m) == (b[2] >= kNearest_m)) return;
  const double t = (kNearest_m - a[2]) / (b[2] - a[2]);
  hull.add(calibration.project({std::lerp(a[0], b[0], t), std::lerp(a[1], b[1], t), kNearest_m}));
}

/// To [-pi, pi].
double wrapped(double angle) { return std::remainder(angle, 2 * std::numbers::pi); }

/// The cuboid's outline cut to the picture; nothing if it is not in the picture.
std::optional<Rectangle> outline(const TrackletPose& pose, const RawCalibration& calibration) {
  const auto corner = corners(pose, calibration);
  Hull hull;
  for (std::size_t from = 0; from < corner.size(); ++from) {
    for (const std::size_t axis : {1u, 2u, 4u}) {
      if ((from & axis) == 0) add_edge(corner[from], corner[from | axis], calibration, hull);
    }
  }
  // Where KITTI's own labels end: a box that reaches beyond the picture is 1241, 374 at the most of
  // 1242 x 375 pixels.
  const double right = calibration.picture.width - 1;
  const double bottom = calibration.picture.height - 1;
  if (!(hull.box.left < right && hull.box.right > 0 && hull.box.top < bottom &&
        hull.box.bottom > 0)) {
    return std::nullopt;
  }
  return Rectangle{std::clamp(hull.box.left, 0.0, right), std::clamp(hull.box.top, 0.0, bottom),
                   std::clamp(hull.box.right, 0.0, right),
                   std::clamp(hull.box.bottom, 0.0, bottom)};
}

}  // namespace

std::optional<Box> to_box(const TrackletPose& pose, const RawCalibration& calibration) {
  const auto seen = outline(pose, calibration);
  if (!seen) return std::nullopt;

  const Point3 place = calibration.to_rectified({pose.x, pose.y, pose.z});
  // With the axes as RawCalibration tells, the length's direction (cos rz, sin rz, 0) of the
  // scanner is
  // (-sin rz, 0, cos rz) of the camera; KITTI object writes that as (cos ry, 0, -sin ry).
  const double rotation_y = wrapped(-pose.rotation_z - std::numbers::pi / 2);

  Box box;
  box.class_id = pose.class_id;
  box.ignore = pose.class_id == kKittiDontCare;
  box.xyxy = *seen;
  box.truncation = pose.truncation == 0 ? 0.f : -1.f;
  box.occlusion = pose.occlusion;
  // The heading as the camera sees it: less the direction in which the object lies.
  box.alpha = static_cast<float>(wrapped(rotation_y - std::atan2(place[0], place[2])));
  const std::array<double, 7> box3d{pose.height, pose.width, pose.length, place[0],
                                    place[1],    place[2],   rotation_y};
  std::ranges::transform(box3d, box.box3d.begin(), [](double x) { return static_cast<float>(x); });
  box.track_id = pose.track;
  return box;
}

}  // namespace eventgan
