#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/faults.h"
#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/placement.h"
#include "stages/base/images/image_file.h"
#include "stages/frames/decoding/cut_out.h"

namespace eventgan {

/// The part of the scaled image that lies in the volume: its size, and its top left pixel's place
/// in either.
struct VisiblePart {
  ImageSize size;
  int scaled_x = 0;
  int scaled_y = 0;
  int volume_x = 0;
  int volume_y = 0;
};

VisiblePart visible_part(const Placement& placement);

/// One frame as the generator sees it, in 8 bits: what is kept while other pairs may want it, since
/// it takes a fraction of the colour image's memory.
struct PreparedFrame {
  /// [y, x] uint8, C order, 0..255: the VisiblePart of the placed image.
  std::vector<std::uint8_t> grey;
  Placement placement;  ///< placement.source is the frame's own size
};

/// A frame that several pairs may hold, or why there is none, without the file's name.
using SharedFrame = std::shared_ptr<const Outcome<PreparedFrame>>;

/// Two frames, ready for the generator.
struct PreparedPair {
  /// [frame, y, x] float32, C order; frame 0 = previous, 1 = next; x = (u/255 - 0.5) * 2 in [-1,
  /// 1]. Only the visible part of the image: with letterbox the borders are left out (no scene
  /// there, no work, no events), with crop what is cut away.
  std::vector<float> input;
  ImageSize content;  ///< size of each frame in `input`
  int content_x = 0;  ///< where `input`'s top left pixel lies in the volume
  int content_y = 0;
  Placement placement;
  FramesBetween between = {};             ///< of a still, where a reader was asked to keep it
  OutlineCounts outlines = {};            ///< of a still whose objects move on their own
  std::optional<FramePair> settled = {};  ///< of a still: the pair it is with its image's size
  PixelFlow flow = {};                    ///< of a still, where a reader was asked for it
};

/// An image [y, x] or [y, x, channel] uint8, C order, 0..255, owned by somebody else.
struct ImageView {
  enum class Channels { kGrey, kBgr, kRgb };

  ImageSize size;
  const std::uint8_t* pixels;
  Channels channels;

  ImageView(ImageSize image_size, const std::uint8_t* data, Channels order = Channels::kBgr)
      : size(image_size), pixels(data), channels(order) {}
  ImageView(const ColourView& frame) : ImageView(frame.size, frame.bgr) {}
};

/// Prepares a frame as `spec` says: grey (ITU-R BT.601, 8 bit), bilinear resizing, Gaussian blur
/// (OpenCV's 8-bit filters, sigma from the kernel's side), cut. Throws std::runtime_error
/// "expected X, got Y" if it cannot be placed or resized. Thread safe.
/// A grey image gives what three equal channels give.
PreparedFrame prepare_frame(const ImageView& frame, const ImageSpec& spec);

/// The generator's input of 8-bit grey: x = (u/255 - 0.5) * 2 in [-1, 1], in single precision.
/// `input` must have the size of `grey`. Thread safe.
void to_input(std::span<const std::uint8_t> grey, std::span<float> input);

/// Both frames, which must have one placement, as the generator's input. Thread safe.
PreparedPair prepare_pair(const PreparedFrame& previous, const PreparedFrame& next);

/// A colour image laid into the volume's frame as the generator's input was (same resizing, same
/// cut, borders black): [y, x, channel] uint8 of size placement.volume, channels blue, green, red.
/// For looking at, not for the network. Throws std::invalid_argument if the frame's size is not the
/// placement's source. Thread safe.
std::vector<std::uint8_t> place_colour(const ColourFrame& frame, const Placement& placement);

}  // namespace eventgan
