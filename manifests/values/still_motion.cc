#include "manifests/values/still_motion.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <stdexcept>
#include <string>

#include "manifests/values/outlines.h"

namespace eventgan {

AffineMap map_of(const ImageMotion& motion, Point centre, double u) {
  const double angle = u * motion.angle_deg * std::numbers::pi / 180;
  const double scale = std::pow(motion.scale, u);
  const double a = scale * std::cos(angle);
  const double b = scale * std::sin(angle);
  return {a, -b, centre.x - a * centre.x + b * centre.y + u * motion.x_px,
          b, a,  centre.y - b * centre.x - a * centre.y + u * motion.y_px};
}

AffineMap compose(const AffineMap& second, const AffineMap& first) {
  const auto& s = second;
  const auto& f = first;
  return {s[0] * f[0] + s[1] * f[3], s[0] * f[1] + s[1] * f[4], s[0] * f[2] + s[1] * f[5] + s[2],
          s[3] * f[0] + s[4] * f[3], s[3] * f[1] + s[4] * f[4], s[3] * f[2] + s[4] * f[5] + s[5]};
}

AffineMap inverse(const AffineMap& map) {
  const double determinant = map[0] * map[4] - map[1] * map[3];
  if (determinant == 0) throw std::invalid_argument("expected a map that has an inverse");
  const double a = map[4] / determinant, b = -map[1] / determinant;
  const double c = -map[3] / determinant, d = map[0] / determinant;
  return {a, b, -a * map[2] - b * map[5], c, d, -c * map[2] - d * map[5]};
}

Point mapped_edge(const AffineMap& map, Point edge) {
  const Point at = mapped(map, {edge.x - 0.5, edge.y - 0.5});
  return {at.x + 0.5, at.y + 0.5};
}

namespace {

Point centre_of(ImageSize size) { return {(size.width - 1) / 2.0, (size.height - 1) / 2.0}; }

/// An edge lies half a pixel before the centre of the pixel with its number.
Point centre_of(const Rectangle& box) {
  return {(box.left + box.right - 1) / 2, (box.top + box.bottom - 1) / 2};
}

}  // namespace

AffineMap image_to_labelled(ImageSize source, const FramePair& pair, double u) {
  const ImageMotion& motion = pair.motion.value();
  const Point centre = centre_of(source);
  return compose(map_of(motion, centre, pair.label_position), inverse(map_of(motion, centre, u)));
}

AffineMap object_to_labelled(ImageSize source, const FramePair& pair, const ImageMotion& object,
                             const Box& box, double u) {
  const Point centre = centre_of(box.xyxy);
  const AffineMap moved_on = map_of(object, centre, pair.label_position);
  const AffineMap moved_back = inverse(map_of(object, centre, u));
  const Point middle = centre_of(source);
  const ImageMotion& motion = pair.motion.value();
  return compose(map_of(motion, middle, pair.label_position),
                 compose(compose(moved_on, moved_back), inverse(map_of(motion, middle, u))));
}

bool moves_alone(const Box& box) { return !box.ignore && !box.outline.empty(); }

ClipWindow clip_window(ImageSize image) {
  const int x = image.width / 8, y = image.height / 8;
  return {x, y, {image.height - 2 * y, image.width - 2 * x}};
}

AffineMap image_in_clip(ImageSize image, const StillPose& pose) {
  return map_of(pose.image, centre_of(image));
}

AffineMap object_in_clip(ImageSize image, const StillPose& pose, const ImageMotion& object,
                         const Box& box) {
  return compose(image_in_clip(image, pose), map_of(object, centre_of(box.xyxy)));
}

namespace {

ImageMotion motion_between(const ImageMotion& from, const ImageMotion& to, double u) {
  const auto at = [u](double a, double b) { return a + u * (b - a); };
  return {at(from.x_px, to.x_px), at(from.y_px, to.y_px), at(from.angle_deg, to.angle_deg),
          from.scale * std::pow(to.scale / from.scale, u)};
}

}  // namespace

StillPose pose_between(const StillPose& from, const StillPose& to, double u) {
  StillPose pose{motion_between(from.image, to.image, u), from.objects};
  for (std::size_t k = 0; k < pose.objects.size(); ++k) {
    if (pose.objects[k] && to.objects.at(k)) {
      pose.objects[k] = motion_between(*from.objects[k], *to.objects[k], u);
    }
  }
  return pose;
}

namespace {

ImageMotion draw(const std::array<double, 2>& translation_px, double rotation_deg, double scale,
                 const CounterRandom& random) {
  const auto between = [&](std::uint64_t counter, double least, double most) {
    return least + (most - least) * random.uniform(counter);
  };
  const double length_px = between(0, translation_px[0], translation_px[1]);
  const double direction = between(1, 0, 2 * std::numbers::pi);
  return {length_px * std::cos(direction), length_px * std::sin(direction),
          between(2, -rotation_deg, rotation_deg), between(3, 1 - scale, 1 + scale)};
}

constexpr std::uint64_t kRests = 4;  // the counter behind those of draw()

ImageMotion draw_moving(const StillsSpec& spec, const CounterRandom& random) {
  return draw(spec.translation_px, spec.rotation_deg, spec.scale, random);
}

/// Whether a pixel's centre lies in the box and, where its size is known, in the image.
bool holds_pixel(const Rectangle& box, const std::optional<ImageSize>& image) {
  const auto between = [&](double begin, double end, int side) {
    const auto first = [&](double edge) {
      const double pixel = std::ceil(edge - 0.5);
      return image ? std::clamp(pixel, 0.0, static_cast<double>(side)) : pixel;
    };
    return first(begin) < first(end);
  };
  const ImageSize size = image.value_or(ImageSize());
  return between(box.left, box.right, size.width) && between(box.top, box.bottom, size.height);
}

/// Whether a pixel's centre in the image lies in the outline: else nobody sees it move.
bool covers_pixel(Outline outline, ImageSize image) {
  const Rectangle around = bounds(outline);
  const auto within = [](double edge, int side) { return std::clamp(edge, 0.0, double(side)); };
  const double left = within(std::floor(around.left), image.width);
  const double top = within(std::floor(around.top), image.height);
  const ImageSize size{static_cast<int>(within(std::ceil(around.bottom), image.height) - top),
                       static_cast<int>(within(std::ceil(around.right), image.width) - left)};
  for (auto& ring : outline.rings) {
    for (Point& corner : ring) corner = {corner.x - left, corner.y - top};
  }
  const GreyImage mask = mask_of(outline, size);
  return std::ranges::any_of(mask.pixels, [](std::uint8_t pixel) { return pixel != 0; });
}

}  // namespace

ImageMotion draw_motion(const StillsSpec& spec, const CounterRandom& pair) {
  const CounterRandom random = pair.keyed("motion");
  const double rests = spec.rests.value_or(spec.objects ? 0.5 : 0);
  return random.uniform(kRests) < rests ? ImageMotion() : draw_moving(spec, random);
}

void settle_motion(const PairSpec& spec, const PairKey& key, const std::vector<Box>& boxes,
                   const std::optional<ImageSize>& image, FramePair& pair) {
  if (!pair.motion || !spec.stills) return;
  const bool image_rests = *pair.motion == ImageMotion();
  const auto& objects = spec.stills->objects;
  // What has no outline is cut out of its box.
  const auto may_move = [&](const Box& box) {
    if (box.ignore) return false;
    if (box.outline.empty()) return holds_pixel(box.xyxy, image);
    return image ? covers_pixel(box.outline, *image) : holds_pixel(bounds(box.outline), image);
  };
  pair.objects.clear();
  if (!objects || std::ranges::none_of(boxes, may_move)) {
    if (image_rests) pair.motion = draw_moving(*spec.stills, key.pair().keyed("motion"));
    return;
  }
  for (std::size_t k = 0; k < boxes.size(); ++k) {
    auto& motion = pair.objects.emplace_back();
    if (!may_move(boxes[k])) continue;
    const CounterRandom random = key.pair().keyed("objects").keyed(std::to_string(k));
    const bool rests = !image_rests && random.uniform(kRests) < objects->rests;
    motion = rests ? ImageMotion()
                   : draw(objects->translation_px, objects->rotation_deg, objects->scale, random);
  }
}

namespace {

double area_of(const Rectangle& box) {
  return std::max(box.right - box.left, 0.0) * std::max(box.bottom - box.top, 0.0);
}

double shared_area(const Rectangle& a, const Rectangle& b) {
  return area_of({std::max(a.left, b.left), std::max(a.top, b.top), std::min(a.right, b.right),
                  std::min(a.bottom, b.bottom)});
}

/// Somebody who waits before a bus is narrow beside it and reaches down to its wheels; riders and
/// bags are wider, and passengers end higher up.
bool stands_before(const Rectangle& box, const Rectangle& other) {
  constexpr double kNarrow = 0.3, kFoot = 0.85;
  return box.right - box.left < kNarrow * (other.right - other.left) &&
         box.bottom > other.top + kFoot * (other.bottom - other.top);
}

bool covers(const Outline& outline, Point at) {
  int winding = 0;
  for (const auto& ring : outline.rings) {
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const Point& a = ring[i];
      const Point& b = ring[i + 1 == ring.size() ? 0 : i + 1];
      if ((a.y > at.y) == (b.y > at.y)) continue;
      if (a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x) > at.x) winding += a.y > b.y ? 1 : -1;
    }
  }
  return winding != 0;
}

/// Whether half of what the other covers is the outline's, too, by a grid of places. So it is of
/// two that were cut out of one another's boxes: one would hide the other as soon as they part.
bool covers_half(const Outline& outline, const Outline& other) {
  constexpr int kSteps = 24;
  const Rectangle around = bounds(other);
  int all = 0, both = 0;
  for (int y = 0; y < kSteps; ++y) {
    for (int x = 0; x < kSteps; ++x) {
      const Point at{around.left + (x + 0.5) / kSteps * (around.right - around.left),
                     around.top + (y + 0.5) / kSteps * (around.bottom - around.top)};
      if (!covers(other, at)) continue;
      ++all;
      both += covers(outline, at);
    }
  }
  return all > 0 && 2 * both >= all;
}

}  // namespace

std::vector<std::size_t> carriers(const std::vector<Box>& boxes) {
  constexpr double kOfAnotherClass = 0.5, kOfTheSame = 0.9;  // share of the smaller one's box
  std::vector<std::size_t> carrier(boxes.size());
  for (std::size_t k = 0; k < boxes.size(); ++k) {
    const Box& box = boxes[k];
    carrier[k] = k;
    double most = 0;
    const double area = area_of(box.xyxy);
    for (std::size_t j = 0; j < boxes.size() && moves_alone(box); ++j) {
      const Box& other = boxes[j];
      if (!moves_alone(other) || !(area_of(other.xyxy) > area)) continue;
      const double share = shared_area(box.xyxy, other.xyxy) / area;
      // Of a box without area the share is no number.
      const bool is_same = other.class_id == box.class_id;
      if (!(share > most) || !(share >= (is_same ? kOfTheSame : kOfAnotherClass))) continue;
      if (is_same ? !covers_half(other.outline, box.outline)
                  : stands_before(box.xyxy, other.xyxy)) {
        continue;
      }
      most = share;
      carrier[k] = j;
    }
  }
  for (std::size_t& last : carrier) {
    while (carrier[last] != last) last = carrier[last];  // each is larger than the one before
  }
  return carrier;
}

namespace {

/// How far a path leads from its start before it turns back.
struct PathLimits {
  double radius_px;
  double angle_deg;
  double log_scale;
};

/// Motions that add up, a frame at a time.
class Path {
 public:
  /// `step`: the first frame's; its direction, pace and turns change from there.
  Path(const ImageMotion& step, const CounterRandom& random, const PathLimits& limits)
      : random_(random),
        limits_(limits),
        speed_px_(std::hypot(step.x_px, step.y_px)),
        heading_(std::atan2(step.y_px, step.x_px)),
        angle_step_(step.angle_deg),
        scale_step_(std::log(step.scale)) {}

  const ImageMotion& at() const { return at_; }

  void advance() {
    constexpr double kTurnChange = 0.05, kMostTurn = 0.15, kSteer = 0.5, kEase = 0.4;  // rad, 1
    constexpr double kPauses = 0.03;
    constexpr std::uint64_t kLeastPause = 3, kPauseChoices = 10;  // frames
    turn_ = std::clamp(turn_ + kTurnChange * (2 * draw() - 1), -kMostTurn, kMostTurn);
    const bool begins = draw() < kPauses;
    const std::uint64_t length = kLeastPause + random_.below(count_++, kPauseChoices);
    if (pause_ > 0)
      --pause_;
    else if (begins)
      pause_ = length;
    pace_ += kEase * ((pause_ > 0 ? 0.0 : 1.0) - pace_);
    heading_ += turn_;
    if (std::hypot(at_.x_px, at_.y_px) > limits_.radius_px) {  // the shorter way round to the start
      const double home = std::atan2(-at_.y_px, -at_.x_px);
      const double off = std::remainder(home - heading_, 2 * std::numbers::pi);
      heading_ += std::clamp(off, -kSteer, kSteer);
    }
    at_.x_px += pace_ * speed_px_ * std::cos(heading_);
    at_.y_px += pace_ * speed_px_ * std::sin(heading_);
    const auto swing = [&](double place, double limit, double& step) {
      if (std::abs(place) > limit && place * step > 0) step = -step;
      return place + pace_ * step;
    };
    at_.angle_deg = swing(at_.angle_deg, limits_.angle_deg, angle_step_);
    at_.scale = std::exp(swing(std::log(at_.scale), limits_.log_scale, scale_step_));
  }

 private:
  double draw() { return random_.uniform(count_++); }

  CounterRandom random_;
  std::uint64_t count_ = 0;
  PathLimits limits_;
  double speed_px_, heading_, angle_step_, scale_step_;
  double turn_ = 0;
  double pace_ = 1;
  std::uint64_t pause_ = 0;
  ImageMotion at_;
};

/// The pose's image, drawn back towards the still until its clip's window sees nothing beyond it.
ImageMotion held(const ImageMotion& motion, ImageSize image) {
  const ClipWindow window = clip_window(image);
  const double right = window.x + window.size.width - 1, bottom = window.y + window.size.height - 1;
  constexpr int kTries = 20;
  for (int i = kTries; i > 0; --i) {
    const ImageMotion part = motion_between({}, motion, double(i) / kTries);
    const AffineMap back = inverse(image_in_clip(image, {part}));
    const std::vector<Point> corners{{double(window.x), double(window.y)},
                                     {right, double(window.y)},
                                     {double(window.x), bottom},
                                     {right, bottom}};
    if (std::ranges::all_of(corners, [&](Point corner) {
          const Point at = mapped(back, corner);
          return at.x >= 0 && at.y >= 0 && at.x <= image.width - 1 && at.y <= image.height - 1;
        })) {
      return part;
    }
  }
  return {};
}

/// The motion about `centre` that is `motion` about `about`.
ImageMotion carried(const ImageMotion& motion, Point about, Point centre) {
  const Point at = mapped(map_of(motion, about), centre);
  return {at.x - centre.x, at.y - centre.y, motion.angle_deg, motion.scale};
}

/// A step no longer than a quarter of the object's size: what looks small is far away.
ImageMotion fitting(ImageMotion step, const Rectangle& box) {
  constexpr double kLongest = 0.25;
  const double longest_px = kLongest * std::sqrt(area_of(box));
  const double length_px = std::hypot(step.x_px, step.y_px);
  if (length_px > longest_px) {
    step.x_px *= longest_px / length_px;
    step.y_px *= longest_px / length_px;
  }
  return step;
}

}  // namespace

std::vector<StillPose> clip_poses(const StillsSpec& spec, const CounterRandom& still,
                                  const std::vector<Box>& boxes,
                                  const std::vector<std::size_t>& carrier, ImageSize image,
                                  int frames) {
  const double side = std::min(image.height, image.width);
  const PathLimits of_image{0.07 * side, 2, 0.02}, of_object{0.3 * side, 10, 0.15};
  std::vector<bool> moves;
  for (const Box& box : boxes) {
    moves.push_back(spec.objects && moves_alone(box) && covers_pixel(box.outline, image));
  }
  const auto is_carried = [&](std::size_t k) { return carrier[k] != k && moves[carrier[k]]; };
  const bool any_moves = std::ranges::find(moves, true) != moves.end();
  const bool image_rests = any_moves && draw_motion(spec, still) == ImageMotion();
  std::optional<Path> path;
  if (!image_rests) {
    path.emplace(draw_moving(spec, still.keyed("motion")), still.keyed("motion").keyed("clip"),
                 of_image);
  }
  std::vector<std::optional<Path>> paths(boxes.size());
  StillPose pose{{}, std::vector<std::optional<ImageMotion>>(any_moves ? boxes.size() : 0)};
  for (std::size_t k = 0; k < pose.objects.size(); ++k) {
    if (!moves[k]) continue;
    pose.objects[k] = ImageMotion();
    if (is_carried(k)) continue;
    const CounterRandom random = still.keyed("objects").keyed(std::to_string(k));
    const auto& objects = *spec.objects;
    if (!image_rests && random.uniform(kRests) < objects.rests) continue;
    const ImageMotion step =
        draw(objects.translation_px, objects.rotation_deg, objects.scale, random);
    paths[k].emplace(fitting(step, boxes[k].xyxy), random.keyed("clip"), of_object);
  }
  std::vector<StillPose> poses{pose};
  for (int i = 0; i < frames; ++i) {
    if (path) {
      path->advance();
      pose.image = held(path->at(), image);
    }
    for (std::size_t k = 0; k < pose.objects.size(); ++k) {
      if (!paths[k]) continue;
      paths[k]->advance();
      pose.objects[k] = paths[k]->at();
    }
    for (std::size_t k = 0; k < pose.objects.size(); ++k) {
      if (!pose.objects[k] || !is_carried(k)) continue;
      const std::size_t by = carrier[k];
      pose.objects[k] =
          carried(pose.objects[by].value(), centre_of(boxes[by].xyxy), centre_of(boxes[k].xyxy));
    }
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace eventgan
