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

Point mapped(const AffineMap& map, Point point) {
  return {map[0] * point.x + map[1] * point.y + map[2],
          map[3] * point.x + map[4] * point.y + map[5]};
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
  const auto moves_alone = [&](const Box& box) {
    return !box.ignore && holds_pixel(box.outline.empty() ? box.xyxy : bounds(box.outline), image);
  };
  pair.objects.clear();
  if (!objects || std::ranges::none_of(boxes, moves_alone)) {
    if (image_rests) pair.motion = draw_moving(*spec.stills, key.pair().keyed("motion"));
    return;
  }
  for (std::size_t k = 0; k < boxes.size(); ++k) {
    auto& motion = pair.objects.emplace_back();
    if (!moves_alone(boxes[k])) continue;
    const CounterRandom random = key.pair().keyed("objects").keyed(std::to_string(k));
    const bool rests = !image_rests && random.uniform(kRests) < objects->rests;
    motion = rests ? ImageMotion()
                   : draw(objects->translation_px, objects->rotation_deg, objects->scale, random);
  }
}

}  // namespace eventgan
