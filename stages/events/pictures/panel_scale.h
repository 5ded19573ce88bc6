#pragma once

#include "manifests/image_size.h"
#include "manifests/labels.h"

namespace eventgan {

/// How volume pixels map to a panel's pixels: enlarged by a whole factor, so that a pixel becomes a
/// square of `factor` x `factor` pixels.
struct PanelScale {
  int factor = 1;

  /// A point (pixel centres are integers) in panel pixels, whose centres are integers too.
  Point point(Point in_volume) const {
    return {(in_volume.x + 0.5) * factor - 0.5, (in_volume.y + 0.5) * factor - 0.5};
  }
  /// The corner of an edge rectangle: edges lie between pixels, and are drawn on the pixel after.
  Point corner(double x, double y) const { return {x * factor - 0.5, y * factor - 0.5}; }
};

/// The largest factor (at most 8) that keeps a panel within 720 pixels each way, at least 1.
PanelScale panel_scale(ImageSize volume);

}  // namespace eventgan
