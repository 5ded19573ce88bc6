#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/labels.h"

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

/// What a preview shows: three panels side by side, each of the volume's size.
struct PreviewContent {
  VolumeShape shape;
  /// [y, x, 3] uint8 blue green red, laid into the volume's frame; empty: the frame was not found.
  std::vector<std::uint8_t> previous_bgr;
  std::vector<std::uint8_t> next_bgr;
  /// [2 bins, y, x] as the shard holds it, decoded to float32; empty: there is none (quarantined).
  std::vector<float> volume;
  std::string title;  ///< one line above the panels
  Annotation annotation;
  VolumeLabels labels;  ///< as many entries as `annotation`
  LabelSchema schema;
};

/// Draws previous frame | next frame | average-timestamp picture, and on all three the boxes (with
/// their class; ignored regions dashed grey) and poses (hidden joints hollow; limbs where the joint
/// names are MPII's or Human3.6M's), and writes a PNG. Small volumes are enlarged by whole factors,
/// so that text and lines stay readable.
///
/// Time is colour, early blue to late red, the mean over both polarities. Brightness says how many
/// events, on an absolute scale, so that noise looks faint: 1 - exp(-m) of full brightness where
/// the pixel's values sum to m; black is no event.
///
/// Throws std::runtime_error naming the path if it cannot be written; std::invalid_argument if the
/// sizes do not fit each other. Thread safe.
void write_preview_png(const PreviewContent& content, const std::filesystem::path& path);

/// The average-timestamp picture of a volume [2 bins, y, x] alone, coloured as above and of the
/// volume's size, as the bytes of a PNG. Throws std::runtime_error if it cannot be encoded. Thread
/// safe.
std::string time_picture_png(std::span<const float> volume, const VolumeShape& shape);

}  // namespace eventgan
