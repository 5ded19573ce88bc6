#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/base/images/image_file.h"

namespace eventgan {

/// How volume pixels map to a panel's pixels: a pixel becomes a square of `factor` x `factor`.
struct PanelScale {
  double factor = 1;

  /// A point (pixel centres are integers) in panel pixels, whose centres are integers too.
  Point point(Point in_volume) const {
    return {(in_volume.x + 0.5) * factor - 0.5, (in_volume.y + 0.5) * factor - 0.5};
  }
  /// The corner of an edge rectangle: edges lie between pixels, and are drawn on the pixel after.
  Point corner(double x, double y) const { return {x * factor - 0.5, y * factor - 0.5}; }
};

/// How a preview's four panels lie: side by side, one below the other, or the frames side by side
/// above the events.
struct PreviewLayout {
  PanelScale scale;
  int columns = 4;
};

/// The layout whose panels are largest, enlarged by a whole factor of at most 8, as long as the
/// image is about as wide as a page, 1420 pixels each way, so that it can be read at 1200; of
/// equals the one with more columns. Volumes too large for that are stacked in one column in their
/// own size.
PreviewLayout preview_layout(ImageSize volume);

/// What a preview shows: four panels, each of the volume's shape.
struct PreviewContent {
  VolumeShape shape;
  /// [y, x, 3] uint8 blue green red, laid into the volume's frame; empty: the frame was not found.
  std::vector<std::uint8_t> previous_bgr;
  std::vector<std::uint8_t> next_bgr;
  /// [2 bins, y, x] as the shard holds it, decoded to float32; empty: there is none (quarantined).
  std::vector<float> volume;
  std::string title;          ///< one line above the panels
  double label_position = 1;  ///< FramePair::label_position
  Annotation annotation;
  VolumeLabels labels;  ///< as many entries as `annotation`
  LabelSchema schema;
  PixelFlow flow = {};  ///< of the volume's size, or empty
};

/// Draws previous frame, next frame, average-timestamp image, and the polarities. The events and
/// the labelled frame, whose panel has a bright border, have the boxes (magenta or white, with
/// their class; ignored regions dashed grey), their outlines as thin lines, and poses (hidden
/// joints hollow; limbs where the joint names are MPII's or Human3.6M's); on another frame, where
/// things have moved, thin dashes hint at them. Flow is arrows on the labelled frame, from the
/// place in the previous frame to that in the next, each direction a colour, where both are seen
/// (dots where nothing moves). A box's name is where it covers boxes least. Small
/// volumes are enlarged by whole factors, so that text and lines stay readable.
///
/// Time is colour, early blue to late red, the mean over both polarities. Brightness says how many
/// events, on an absolute scale, so that noise looks faint: 1 - exp(-m) of full brightness where
/// the pixel's values sum to m; black is no event. Of the polarities, on white, positive events are
/// red, negative ones blue, as strong as the times are bright.
///
/// Throws std::invalid_argument if the sizes do not fit each other, std::runtime_error if OpenCV
/// cannot draw them. Thread safe.
ColourFrame draw_preview(const PreviewContent& content);

/// The same in small, `width` pixels wide: the labelled frame (of a label between the two the next
/// one, with dashes) and the events, side by side, or below each other where volumes are wide, with
/// the title above.
ColourFrame draw_tile(const PreviewContent& content, int width);

/// Tiles in rows of `columns` in their order: a contact sheet. At least one tile.
ColourFrame draw_sheet(std::span<const ColourFrame> tiles, int columns);

/// A volume [2 bins, y, x] as an image that any loader opens, of its size, as the bytes of a PNG:
/// with P and N the sums of a pixel's positive and negative bins over `full_scale`, red is P, green
/// 0.5 + (P - N) / 2 and blue N, each within 0..1 times 255, rounded. Thread safe.
std::string polarity_image_png(std::span<const float> volume, const VolumeShape& shape,
                               double full_scale);

/// The largest P or N of a volume's pixels, with a full scale of 1. Thread safe.
double largest_polarity_sum(std::span<const float> volume, const VolumeShape& shape);

/// The average-timestamp image of a volume [2 bins, y, x] alone, coloured as above and of the
/// volume's size, as the bytes of a PNG. Throws std::runtime_error if it cannot be encoded. Thread
/// safe.
std::string time_image_png(std::span<const float> volume, const VolumeShape& shape);

}  // namespace eventgan
