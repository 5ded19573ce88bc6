#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/synthetic/scenes/camera.h"
#include "stages/synthetic/scenes/image.h"

namespace eventgan {

/// Human3.6M's 32 joints by number, as its recordings order them. Several lie on one place there
/// (11 on 0, 16 and 24 on 13, 20 on 19, 28 on 27, 23 on 22, 31 on 30), and so they do here.
enum Human36mJoint {
  kHips = 0,
  kRightHip = 1,
  kRightKnee = 2,
  kRightAnkle = 3,
  kRightToeBase = 4,
  kRightToe = 5,
  kLeftHip = 6,
  kLeftKnee = 7,
  kLeftAnkle = 8,
  kLeftToeBase = 9,
  kLeftToe = 10,
  kSpineBase = 11,
  kSpine = 12,
  kThorax = 13,
  kNeck = 14,
  kHeadTop = 15,
  kLeftCollar = 16,
  kLeftShoulder = 17,
  kLeftElbow = 18,
  kLeftWrist = 19,
  kLeftHand = 20,
  kLeftThumb = 21,
  kLeftFingers = 22,
  kLeftFingersEnd = 23,
  kRightCollar = 24,
  kRightShoulder = 25,
  kRightElbow = 26,
  kRightWrist = 27,
  kRightHand = 28,
  kRightThumb = 29,
  kRightFingers = 30,
  kRightFingersEnd = 31,
};
inline constexpr std::size_t kFigureJoints = 32;

/// A place for each joint, mm, in the camera's frame.
using Joints3d = std::array<Vector3, kFigureJoints>;

/// How a walking, waving figure looks and moves. Its place and pose at a frame follow from this
/// alone.
struct FigureMotion {
  Vector3 start;       ///< ground under the hips at frame 0, mm
  Vector3 step;        ///< mm per frame
  double heading = 0;  ///< rad; 0 faces the camera, π/2 faces along x
  double phase = 0;    ///< of the gait at frame 0, rad
  double pace = 0.1;   ///< gait, rad per frame
  Colour clothes{120, 120, 120};
  bool waves = false;  ///< with the right arm
};

Joints3d pose(const FigureMotion& motion, double frame);

/// A limb: the round bar between two points.
struct Limb3d {
  Vector3 from;
  Vector3 to;
  double radius = 0;  ///< mm
  Colour colour;
};

/// True if the point lies inside the limb.
bool is_inside(const Limb3d& limb, const Vector3& point);

/// The bars that the figure is made of. Every joint lies inside at least one of them.
std::vector<Limb3d> limbs(const Joints3d& joints, const Colour& clothes);

/// The part of `limbs` that is the head; the joint kHeadTop lies at its upper end.
Limb3d head(const Joints3d& joints);

/// A limb as an image shows it: the pixels within `radius` of a line.
struct DrawnLimb {
  Point from;
  Point to;
  double radius = 0;  ///< px
  double depth = 0;   ///< mean distance of its ends from the camera, mm
};

DrawnLimb drawn_limb(const Limb3d& limb, const Intrinsics& camera);

/// Where a point lies beside a limb: how far along its line (0..1) and how far off it (px).
struct LimbPlace {
  double along = 0;
  double distance = 0;
};

LimbPlace place_on(const DrawnLimb& limb, const Point& point);

/// The rectangle around a drawn limb, edges in px.
Rectangle bounds_of(const DrawnLimb& limb);

/// Paints a limb with a pattern that is fixed to it and an edge softened over one pixel onto
/// `canvas`, and notes `object` where it covers a pixel's centre.
void draw_limb(const Limb3d& limb, const Intrinsics& camera, const Texture& texture, int object,
               ImageSize size, std::vector<Colour>& canvas, std::vector<int>& objects);

}  // namespace eventgan
