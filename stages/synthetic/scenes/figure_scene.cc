#include "stages/synthetic/scenes/figure_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "manifests/values/counter_random.h"
#include "stages/synthetic/scenes/camera.h"
#include "stages/synthetic/scenes/figure.h"

namespace eventgan {
namespace {

/// A plastered wall with a dado and a tiled floor; `texture` makes each scene's own.
Colour wall_colour(const Texture& texture, int x, int y, ImageSize size) {
  const Colour tone = mix(Colour{170, 185, 175}, Colour{200, 180, 165}, texture.cell(-1, 0));
  const float coarse = texture.noise(x / 23.0, y / 17.0) - 0.5f;
  const float fine = texture.noise(x / 4.0, y / 4.0) - 0.5f;
  const int floor_top = size.height * 4 / 5;
  if (y >= floor_top) {
    // Tiles that grow towards the camera.
    const double depth = 40.0 / (y - floor_top + 6);
    const int column = static_cast<int>(std::floor((x - size.width / 2.0) * depth / 18));
    const int row = static_cast<int>(std::floor(depth * 6));
    const float tile = texture.cell(column, row + 100);
    return Colour{95, 115, 135} * (0.75f + 0.5f * tile) + Colour{1, 1, 1} * (16 * fine);
  }
  if (std::abs(y - size.height * 11 / 20) < 3) return Colour{80, 100, 120} * (1 + 0.3f * fine);
  return tone + Colour{1, 1, 1} * (46 * coarse + 22 * fine);
}

/// A limb hides a joint only if it is nearer by this much (mm): people see where a hip is although
/// the thigh beside it covers its middle.
constexpr double kClearlyNearer = 120;

/// Hidden if a limb covers the joint without holding it.
bool is_visible(const std::vector<Limb3d>& limbs, const Vector3& joint, const Intrinsics& camera) {
  const Point at = project(camera, joint);
  return std::none_of(limbs.begin(), limbs.end(), [&](const Limb3d& limb) {
    const DrawnLimb drawn = drawn_limb(limb, camera);
    return place_on(drawn, at).distance < drawn.radius && drawn.depth < joint.z - kClearlyNearer &&
           !is_inside(limb, joint);
  });
}

}  // namespace

FigureScene::FigureScene(std::uint64_t seed, const Intrinsics& camera,
                         std::vector<FigureMotion> figures)
    : texture_(CounterRandom(seed).keyed("figures")),
      camera_(camera),
      figures_(std::move(figures)) {
  for (int y = 0; y < size().height; ++y) {
    for (int x = 0; x < size().width; ++x) wall_.push_back(wall_colour(texture_, x, y, size()));
  }
}

std::vector<Limb3d> FigureScene::limbs_of(std::size_t figure, double frame) const {
  return limbs(pose(figures_[figure], frame), figures_[figure].clothes);
}

FigureScene::Drawing FigureScene::draw(double frame) const {
  struct Part {
    Limb3d limb;
    int figure;
  };
  std::vector<Part> parts;
  for (std::size_t i = 0; i < figures_.size(); ++i) {
    for (const Limb3d& limb : limbs_of(i, frame)) parts.push_back({limb, static_cast<int>(i)});
  }
  // Far ones first; nearer ones are painted over them.
  std::stable_sort(parts.begin(), parts.end(), [](const Part& a, const Part& b) {
    return a.limb.from.z + a.limb.to.z > b.limb.from.z + b.limb.to.z;
  });

  Drawing drawing{wall_, std::vector<int>(size().pixel_count(), -1)};
  for (const Part& part : parts) {
    draw_limb(part.limb, camera_, texture_, part.figure, size(), drawing.canvas, drawing.objects);
  }
  return drawing;
}

Image FigureScene::render(double frame) const {
  const Drawing drawing = draw(frame);
  Image image = black_image(size());
  for (int y = 0; y < size().height; ++y) {
    for (int x = 0; x < size().width; ++x) {
      set_pixel(image, x, y, drawing.canvas[static_cast<std::size_t>(y) * size().width + x]);
    }
  }
  return image;
}

std::vector<int> FigureScene::objects(double frame) const { return draw(frame).objects; }

std::vector<FigureLabel> FigureScene::labels(double frame) const {
  std::vector<Limb3d> all;
  for (std::size_t i = 0; i < figures_.size(); ++i) {
    for (const Limb3d& limb : limbs_of(i, frame)) all.push_back(limb);
  }
  std::vector<FigureLabel> labels;
  for (std::size_t i = 0; i < figures_.size(); ++i) {
    FigureLabel label;
    label.joints3d = pose(figures_[i], frame);
    for (std::size_t joint = 0; joint < kFigureJoints; ++joint) {
      label.joints[joint] = project(camera_, label.joints3d[joint]);
      label.visible[joint] = is_visible(all, label.joints3d[joint], camera_);
    }
    label.head_box = bounds_of(drawn_limb(head(label.joints3d), camera_));
    label.outline = label.head_box;
    for (const Limb3d& limb : limbs_of(i, frame)) {
      const Rectangle bounds = bounds_of(drawn_limb(limb, camera_));
      label.outline = {std::min(label.outline.left, bounds.left),
                       std::min(label.outline.top, bounds.top),
                       std::max(label.outline.right, bounds.right),
                       std::max(label.outline.bottom, bounds.bottom)};
    }
    labels.push_back(label);
  }
  return labels;
}

FigureMotion cast_figure(std::uint64_t seed, std::string_view role) {
  const CounterRandom random = CounterRandom(seed).keyed(role);
  const auto between = [&](int counter, double low, double high) {
    return low + (high - low) * random.uniform(static_cast<std::uint64_t>(counter));
  };
  FigureMotion motion;
  const double side = random.uniform(0) < 0.5 ? -1 : 1;  // the way it walks
  motion.start = {-side * between(1, 150, 450), between(2, 900, 980), between(3, 4400, 5000)};
  motion.step = {side * between(4, 8, 15), 0, between(5, -4, 4)};
  motion.heading = side * between(6, 0.3, 1.1);
  motion.phase = between(7, 0, 6.28);
  motion.pace = between(8, 0.09, 0.13);
  motion.waves = random.uniform(9) < 0.7;
  const auto tone = [&](int counter) { return static_cast<float>(between(counter, 60, 210)); };
  motion.clothes = {tone(10), tone(11), tone(12)};
  return motion;
}

FigureMotion seen_from(const FigureMotion& motion, const Vector3& pivot, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  const auto turned = [&](const Vector3& v) {
    return Vector3{c * v.x - s * v.z, v.y, s * v.x + c * v.z};
  };
  FigureMotion seen = motion;
  seen.start = pivot + turned(motion.start - pivot);
  seen.step = turned(motion.step);
  seen.heading = motion.heading + angle;
  return seen;
}

}  // namespace eventgan
