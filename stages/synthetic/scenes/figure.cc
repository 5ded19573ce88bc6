#include "stages/synthetic/scenes/figure.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stages/synthetic/scenes/camera.h"

namespace eventgan {
namespace {

// The figure's measures in mm: a person of about 1.75 m.
constexpr double kThigh = 440;
constexpr double kShin = 430;
constexpr double kAnkleHeight = 80;
constexpr double kUpperArm = 290;
constexpr double kForearm = 250;
constexpr double kHeadRadius = 95;

constexpr Colour kSkin{140, 175, 225};
constexpr Colour kTrousers{120, 75, 50};
constexpr Colour kShoes{40, 40, 45};

/// The directions of a standing body in the camera's frame.
struct BodyFrame {
  Vector3 forward;
  Vector3 left;
  Vector3 down{0, 1, 0};

  /// Straight down turned forward by `angle`.
  Vector3 swung(double angle) const { return forward * std::sin(angle) + down * std::cos(angle); }
};

BodyFrame body_frame(double heading) {
  return {{std::sin(heading), 0, -std::cos(heading)}, {std::cos(heading), 0, std::sin(heading)}};
}

/// One leg from hip to toe; `first` is the hip's joint number, the others follow it.
void place_leg(Joints3d& joints, int first, const BodyFrame& body, double phase) {
  const double thigh = 0.42 * std::sin(phase);
  const double knee = 0.15 + 0.55 * std::max(0.0, std::cos(phase));  // bent while it swings forward
  joints[first + 1] = joints[first] + body.swung(thigh) * kThigh;
  joints[first + 2] = joints[first + 1] + body.swung(thigh - knee) * kShin;
  const Vector3 foot = body.swung(thigh - knee + 1.35);
  joints[first + 3] = joints[first + 2] + foot * 130;
  joints[first + 4] = joints[first + 2] + foot * 190;
}

/// One arm from collar to finger tips; `first` is the collar's joint number, `out` points outwards.
void place_arm(Joints3d& joints, int first, const BodyFrame& body, const Vector3& out,
               const Vector3& upper, const Vector3& lower) {
  joints[first] = joints[kThorax];
  joints[first + 1] = joints[kThorax] + out * 175 + body.down * 25;
  joints[first + 2] = joints[first + 1] + upper * kUpperArm;
  joints[first + 3] = joints[first + 2] + lower * kForearm;
  joints[first + 4] = joints[first + 3];
  joints[first + 5] = joints[first + 3] + lower * 60 + body.forward * 45;
  joints[first + 6] = joints[first + 3] + lower * 110;
  joints[first + 7] = joints[first + 6];
}

}  // namespace

Joints3d pose(const FigureMotion& motion, double frame) {
  const BodyFrame body = body_frame(motion.heading);
  const double phase = motion.phase + motion.pace * frame;
  const Vector3 ground = motion.start + motion.step * frame;
  const double hip_height = kThigh + kShin + kAnkleHeight - 25 + 12 * std::cos(2 * phase);

  Joints3d joints;
  joints[kHips] = ground - body.down * hip_height;
  joints[kSpineBase] = joints[kHips];
  joints[kRightHip] = joints[kHips] - body.left * 110;
  joints[kLeftHip] = joints[kHips] + body.left * 110;
  place_leg(joints, kRightHip, body, phase);
  place_leg(joints, kLeftHip, body, phase + std::numbers::pi);

  const double lean = -0.06;
  joints[kSpine] = joints[kHips] - body.swung(lean) * 240;
  joints[kThorax] = joints[kHips] - body.swung(lean) * 490;
  joints[kNeck] = joints[kThorax] - body.down * 95 + body.forward * 25;
  joints[kHeadTop] = joints[kNeck] - body.down * 215;

  const double swing = 0.45 * std::sin(phase);
  place_arm(joints, kLeftCollar, body, body.left, body.swung(swing), body.swung(swing + 0.5));
  const Vector3 right = body.left * -1;
  if (motion.waves) {
    const double wave = 0.5 * std::sin(2 * phase);
    const Vector3 raised = right * std::cos(0.35) - body.down * std::sin(0.35);
    const Vector3 waving = right * std::sin(0.25 + wave) - body.down * std::cos(0.25 + wave);
    place_arm(joints, kRightCollar, body, right, raised, waving);
  } else {
    place_arm(joints, kRightCollar, body, right, body.swung(-swing), body.swung(0.5 - swing));
  }
  return joints;
}

bool is_inside(const Limb3d& limb, const Vector3& point) {
  const Vector3 line = limb.to - limb.from;
  const Vector3 off = point - limb.from;
  const double square = dot(line, line);
  const double share = square == 0 ? 0 : std::clamp(dot(off, line) / square, 0.0, 1.0);
  return length(off - line * share) <= limb.radius;
}

Limb3d head(const Joints3d& joints) {
  const Vector3 axis = joints[kHeadTop] - joints[kNeck];
  const Vector3 up = axis * (1 / length(axis));
  // A little less than a radius below the top, so that the joint lies inside.
  return {joints[kNeck] + up * 70, joints[kHeadTop] - up * (kHeadRadius - 10), kHeadRadius, kSkin};
}

std::vector<Limb3d> limbs(const Joints3d& joints, const Colour& clothes) {
  std::vector<Limb3d> result;
  const auto add = [&](int from, int to, double radius, const Colour& colour) {
    result.push_back({joints[from], joints[to], radius, colour});
  };
  for (const int hip : {kRightHip, kLeftHip}) {
    add(kHips, hip, 90, kTrousers);
    add(hip, hip + 1, 72, kTrousers);
    add(hip + 1, hip + 2, 55, kTrousers);
    add(hip + 2, hip + 4, 42, kShoes);
  }
  add(kHips, kThorax, 125, clothes);
  for (const int collar : {kLeftCollar, kRightCollar}) {
    add(collar, collar + 1, 62, clothes);
    add(collar + 1, collar + 2, 50, clothes);
    add(collar + 2, collar + 3, 40, kSkin);
    add(collar + 3, collar + 6, 34, kSkin);
    add(collar + 3, collar + 5, 20, kSkin);
  }
  add(kThorax, kNeck, 52, kSkin);
  result.push_back(head(joints));
  return result;
}

DrawnLimb drawn_limb(const Limb3d& limb, const Intrinsics& camera) {
  const double depth = (limb.from.z + limb.to.z) / 2;
  return {project(camera, limb.from), project(camera, limb.to),
          limb.radius * camera.focal_x / depth, depth};
}

LimbPlace place_on(const DrawnLimb& limb, const Point& point) {
  const double x = limb.to.x - limb.from.x;
  const double y = limb.to.y - limb.from.y;
  const double square = x * x + y * y;
  const double share =
      square == 0 ? 0 : ((point.x - limb.from.x) * x + (point.y - limb.from.y) * y) / square;
  const double along = std::clamp(share, 0.0, 1.0);
  return {along, std::hypot(point.x - limb.from.x - along * x, point.y - limb.from.y - along * y)};
}

Rectangle bounds_of(const DrawnLimb& limb) {
  // Half a pixel, since edges lie between pixels and points on their centres.
  return {std::min(limb.from.x, limb.to.x) - limb.radius + 0.5,
          std::min(limb.from.y, limb.to.y) - limb.radius + 0.5,
          std::max(limb.from.x, limb.to.x) + limb.radius + 0.5,
          std::max(limb.from.y, limb.to.y) + limb.radius + 0.5};
}

void draw_limb(const Limb3d& limb, const Intrinsics& camera, const Texture& texture, int object,
               ImageSize size, std::vector<Colour>& canvas, std::vector<int>& objects) {
  const DrawnLimb drawn = drawn_limb(limb, camera);
  const Rectangle bounds = bounds_of(drawn);
  const double limb_mm = length(limb.to - limb.from);
  const int left = std::max(0, static_cast<int>(bounds.left) - 1);
  const int right = std::min(size.width - 1, static_cast<int>(bounds.right) + 1);
  const int top = std::max(0, static_cast<int>(bounds.top) - 1);
  const int bottom = std::min(size.height - 1, static_cast<int>(bounds.bottom) + 1);
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const LimbPlace place = place_on(drawn, {static_cast<double>(x), static_cast<double>(y)});
      const double cover = std::clamp(drawn.radius - place.distance + 0.5, 0.0, 1.0);
      if (cover <= 0) continue;
      const double across = place.distance / drawn.radius;  // 0 on the line, 1 at the edge
      const float roundness = static_cast<float>(1.0 - 0.35 * across * across);
      const float pattern =
          0.75f + 0.5f * texture.noise(place.along * limb_mm / 45, across * 2.5 + limb.radius);
      const std::size_t pixel = static_cast<std::size_t>(y) * size.width + x;
      canvas[pixel] =
          mix(canvas[pixel], limb.colour * (roundness * pattern), static_cast<float>(cover));
      if (place.distance <= drawn.radius) objects[pixel] = object;
    }
  }
}

}  // namespace eventgan
