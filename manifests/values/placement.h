#pragma once

#include <array>

#include "manifests/values/frames.h"
#include "manifests/values/job.h"

namespace eventgan {

/// Where a source image comes to lie in the volume: scaled to `scaled`, then laid with its top
/// left corner at (`offset_y`, `offset_x`) of a volume of size `volume`. Offsets are positive with
/// borders (letterbox) and negative where the image is cut (crop).
///
/// Both axes scale by exact ratios, s = scaled / source, so that
///   a point (pixel centres are integers) maps as x' = (x + 0.5) s - 0.5 + offset,
///   an edge maps as                              x' = x s + offset.
struct Placement {
  ImageSize source;
  ImageSize scaled;
  ImageSize volume;
  int offset_x = 0;
  int offset_y = 0;

  double scale_x() const { return static_cast<double>(scaled.width) / source.width; }
  double scale_y() const { return static_cast<double>(scaled.height) / source.height; }

  /// The map of points, row-major [2][3]: [x', y'] = M [x, y, 1]. This is
  /// `/pairs/source_to_volume`.
  std::array<double, 6> source_to_volume() const;

  bool operator==(const Placement&) const = default;
};

/// The placement for one source size:
///   stretch: scaled = volume, offsets 0;
///   letterbox: the largest size of the same shape that fits, each side rounded to whole pixels (≥
///   1), in the middle; crop: the smallest size of the same shape that covers, each side rounded
///   (never below the volume), its middle.
/// Offsets are floor((volume - scaled) / 2). Without `spec.size` the image keeps its own size.
/// Throws std::invalid_argument for an empty source.
Placement place(ImageSize source, const ImageSpec& spec);

}  // namespace eventgan
