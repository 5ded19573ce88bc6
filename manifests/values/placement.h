#pragma once

#include <array>
#include <optional>

#include "manifests/values/frames.h"
#include "manifests/values/job.h"

namespace eventgan {

/// Where a source image comes to lie in the volume: without borders of `border_x` pixels left and
/// right and `border_y` above and below (0 but of a still's pair), it is scaled to `scaled`, then
/// laid with its top left corner at (`offset_y`, `offset_x`) of a volume of size `volume`. Offsets
/// are positive with borders (letterbox) and negative where the image is cut (crop).
///
/// Both axes scale by exact ratios, s = scaled / (source - 2 border), so that
///   a point (pixel centres are integers) maps as x' = (x - border + 0.5) s - 0.5 + offset,
///   an edge maps as                              x' = (x - border) s + offset.
struct Placement {
  ImageSize source;
  ImageSize scaled;
  ImageSize volume;
  int offset_x = 0;
  int offset_y = 0;
  int border_x = 0;
  int border_y = 0;

  /// What is left of the source without its borders.
  ImageSize cut() const { return {source.height - 2 * border_y, source.width - 2 * border_x}; }

  double scale_x() const { return static_cast<double>(scaled.width) / cut().width; }
  double scale_y() const { return static_cast<double>(scaled.height) / cut().height; }

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

/// Of a still's pair, which has a motion: where the point [x, y, 1] of the moved frame lies in the
/// labelled image, row-major [2][3], pixel centres being integers. The motion leads there if the
/// labelled frame is the next one, its inverse if it is the previous one.
std::array<double, 6> moved_to_labelled(ImageSize source, const FramePair& pair);

/// What both frames of a still's pair lose, since only one of them shows it: so many rows above and
/// below, and columns left and right. Along the image's shorter axis it is n pixels, along the
/// other round(n long / short), with the least n ≥ 0 for which moved_to_labelled leads from every
/// pixel's centre in the rest to a place between the centres of the source's outermost pixels. None
/// if less than half of a side would be left.
std::optional<ImageSize> still_border(ImageSize source, const FramePair& pair);

/// The placement of both frames of a pair, of a still's pair without its borders. `scaled` and the
/// offsets are those of the whole image, so that images of one size give volumes of one shape
/// whatever their motions. Throws std::invalid_argument also if there is no still_border.
Placement place(ImageSize source, const ImageSpec& spec, const FramePair& pair);

}  // namespace eventgan
