#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {

/// A clip that is made of a still (FramePair::poses): what its window (clip_window) shows of the
/// image and its objects, at any pose. Objects that move on their own lie over the image, the
/// farther ones first, and what they uncover is filled (detail/still_layers.h). Thread safe.
class StillClip {
 public:
  /// `image` must outlive it. `boxes`: of the still; those with an outline and a motion in `pose`,
  /// which is any one of the clip, are objects. Throws std::runtime_error as prepare_still.
  StillClip(const ImageView& image, std::vector<Box> boxes, const StillPose& pose);

  ImageSize size() const;

  /// The frame at a pose: [y, x, channel] uint8 of size(), with the image's channels. Throws
  /// std::runtime_error if OpenCV refuses it.
  std::vector<std::uint8_t> frame(const StillPose& pose) const;

  /// No point of a frame moves farther from the one pose to the other.
  double displacement_px(const StillPose& from, const StillPose& to) const;

  /// How far what a pixel of the frame at `from` shows, the nearest object or the image, lies from
  /// there at `to`: [y, x] float32 of size(), x, then y, in pixels.
  std::array<std::vector<float>, 2> shifts_px(const StillPose& from, const StillPose& to) const;

 private:
  struct State;
  std::shared_ptr<const State> state_;
};

}  // namespace eventgan
