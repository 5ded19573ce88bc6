#include "manifests/values/placement.h"

#include <algorithm>
#include <cstdint>
#include <limits>
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
  return {sx, 0,  0.5 * sx - 0.5 + offset_x,  //
          0,  sy, 0.5 * sy - 0.5 + offset_y};
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

}  // namespace eventgan
