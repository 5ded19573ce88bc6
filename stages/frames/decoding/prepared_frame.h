#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "manifests/faults.h"
#include "manifests/job_manifest.h"
#include "manifests/placement.h"
#include "stages/frames/decoding/colour_frame.h"

namespace eventgan {

/// One frame as the generator sees it, in 8 bits: what is kept while other pairs may want it, since
/// it takes a fraction of the colour picture's memory.
struct PreparedFrame {
  /// [y, x] uint8, C order, 0..255: the visible part (visible_part.h) of the placed picture.
  std::vector<std::uint8_t> grey;
  Placement placement;  ///< placement.source is the frame's own size
};

/// A frame that several pairs may hold, or why there is none, without the file's name.
using SharedFrame = std::shared_ptr<const Outcome<PreparedFrame>>;

/// Prepares a frame as `spec` says: grey (ITU-R BT.601, 8 bit), bilinear resizing, Gaussian blur
/// (OpenCV's 8-bit filters, sigma from the kernel's side), cut. Throws std::runtime_error "expected
/// frames that can be resized, got ..." if it cannot be placed or resized. Thread safe.
PreparedFrame prepare_frame(const ColourView& frame, const ImageSpec& spec);

/// The generator's input of 8-bit grey: x = (u/255 - 0.5) * 2 in [-1, 1], in single precision.
/// `input` must have the size of `grey`. Thread safe.
void to_input(std::span<const std::uint8_t> grey, std::span<float> input);

}  // namespace eventgan
