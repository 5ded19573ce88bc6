#include "manifests/values/placement.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <stdexcept>
#include <string>

namespace eventgan {
namespace {

/// round(side * to / from), at least 1; all in whole numbers, so the same everywhere.
int scaled_side(int side, int from, int to) {
  const std::int64_t product = std::int64_t{side} * to;
  const std::int64_t rounded = product / from + (product % from >= from - product % from ? 1 : 0);
  if (rounded > std::numeric_limits<int>::max()) {
    throw std::invalid_argument(
        "expected a scaled image of at most 2147483647 pixels a side, got " +
        std::to_string(rounded));
  }
  return std::max(static_cast<int>(rounded), 1);
}

void require_pixels(ImageSize size, const char* what) {
  if (size.height >= 1 && size.width >= 1) return;
  throw std::invalid_argument(std::string("expected a ") + what + " of at least 1x1 pixels, got " +
                              to_string(size));
}

ImageSize scaled_size(ImageSize source, ImageSize volume, ImageFit fit) {
  if (fit == ImageFit::kStretch) return volume;
  // volume.width / source.width against volume.height / source.height, without division.
  const std::int64_t by_width = std::int64_t{volume.width} * source.height;
  const std::int64_t by_height = std::int64_t{volume.height} * source.width;
  const bool crop = fit == ImageFit::kCrop;
  // One axis fits exactly; the other is rounded, and rounding must not undo "fits" or "covers": it
  // cannot, since rounding never passes a whole number that the exact value has not passed.
  if (crop ? by_width >= by_height : by_width <= by_height) {
    return {scaled_side(source.height, source.width, volume.width), volume.width};
  }
  return {volume.height, scaled_side(source.width, source.height, volume.height)};
}

}  // namespace

std::array<double, 6> Placement::source_to_volume() const {
  const double sx = scale_x();
  const double sy = scale_y();
  return {sx, 0,  (0.5 - border_x) * sx - 0.5 + offset_x,  //
          0,  sy, (0.5 - border_y) * sy - 0.5 + offset_y};
}

Placement place(ImageSize source, const ImageSpec& spec) {
  require_pixels(source, "source image");
  const ImageSize volume = spec.size.value_or(source);
  require_pixels(volume, "volume");
  Placement placement{source, scaled_size(source, volume, spec.fit), volume, 0, 0};
  // Shifting right rounds towards minus infinity, as the contract says; division would not.
  placement.offset_x = (volume.width - placement.scaled.width) >> 1;
  placement.offset_y = (volume.height - placement.scaled.height) >> 1;
  return placement;
}

std::array<double, 6> moved_to_labelled(ImageSize source, const FramePair& pair) {
  const ImageMotion motion = pair.motion.value();
  const double angle = motion.angle_deg * std::numbers::pi / 180;
  double a = motion.scale * std::cos(angle);  // s R = [a, -b; b, a]
  double b = motion.scale * std::sin(angle);
  double x = motion.x_px;
  double y = motion.y_px;
  if (pair.label_position == 0) {  // (s R)^-1 = [a, b; -b, a] / s^2
    a /= motion.scale * motion.scale;
    b /= -motion.scale * motion.scale;
    const double forward_x = x;
    x = b * y - a * x;
    y = -b * forward_x - a * y;
  }
  const double centre_x = (source.width - 1) / 2.0;
  const double centre_y = (source.height - 1) / 2.0;
  return {a, -b, centre_x - a * centre_x + b * centre_y + x,  //
          b, a,  centre_y - b * centre_x - a * centre_y + y};
}

namespace {

/// Whether moved_to_labelled leads from all of `cut`, in the middle of the source, into it. The map
/// is affine and both are symmetric about its centre, so the farthest corner on each axis decides.
bool stays_inside(ImageSize cut, ImageSize source, const FramePair& pair) {
  constexpr double kRounding_px = 1e-9;
  const std::array<double, 6> map = moved_to_labelled(source, pair);
  const double centre_x = (source.width - 1) / 2.0;
  const double centre_y = (source.height - 1) / 2.0;
  const double reach_x = (cut.width - 1) / 2.0;
  const double reach_y = (cut.height - 1) / 2.0;
  const auto fits = [&](const double* row, double centre) {
    const double middle = row[0] * centre_x + row[1] * centre_y + row[2];
    return std::abs(middle - centre) + std::abs(row[0]) * reach_x + std::abs(row[1]) * reach_y <=
           centre + kRounding_px;
  };
  return fits(&map[0], centre_x) && fits(&map[3], centre_y);
}

}  // namespace

std::optional<ImageSize> still_border(ImageSize source, const FramePair& pair) {
  const std::int64_t shorter = std::min(source.width, source.height);
  if (shorter < 1) return std::nullopt;
  const auto along = [&](int side, std::int64_t n) {
    return static_cast<int>((2 * n * side + shorter) / (2 * shorter));  // rounded
  };
  for (std::int64_t n = 0; 4 * n <= shorter; ++n) {
    const ImageSize border{along(source.height, n), along(source.width, n)};
    const ImageSize cut{source.height - 2 * border.height, source.width - 2 * border.width};
    if (2 * cut.width < source.width || 2 * cut.height < source.height) break;
    if (stays_inside(cut, source, pair)) return border;
  }
  return std::nullopt;
}

Placement place(ImageSize source, const ImageSpec& spec, const FramePair& pair) {
  Placement placement = place(source, spec);
  if (!pair.motion) return placement;
  const std::optional<ImageSize> border = still_border(source, pair);
  if (!border) {
    const ImageMotion& motion = *pair.motion;
    throw std::invalid_argument(
        "expected a motion after which half of each side can be seen of an image of " +
        to_string(source) + " pixels, got (" + std::to_string(motion.x_px) + ", " +
        std::to_string(motion.y_px) + ") px, " + std::to_string(motion.angle_deg) +
        " degrees, scale " + std::to_string(motion.scale));
  }
  placement.border_x = border->width;
  placement.border_y = border->height;
  return placement;
}

}  // namespace eventgan
