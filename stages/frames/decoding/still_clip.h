#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/labels.h"
#include "manifests/values/placement.h"
#include "manifests/values/still_motion.h"
#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {

/// A clip that is made of a still (FramePair::poses): what its window (clip_window) shows of the
/// image and its objects, at any pose. Objects that move on their own lie over the image, the
/// farther ones first, and what they uncover is filled (detail/still_layers.h). Thread safe.
class StillClip {
 public:
  /// `image` must outlive it. `boxes`: of the still; those with an outline and a motion in `pose`,
  /// which is any one of the clip, are objects. Throws std::runtime_error as MovingStill.
  StillClip(const ImageView& image, std::vector<Box> boxes, const StillPose& pose);

  ImageSize size() const;

  /// The frame at a pose: [y, x, channel] uint8 of size(), with the image's channels. Throws
  /// std::runtime_error if OpenCV refuses it.
  std::vector<std::uint8_t> frame(const StillPose& pose) const;

  /// Makes that frame of a pose, grey and resized by `placement`, which is of an image of size():
  /// [y, x] uint8 of placement.scaled (detail/scaled_layers.h). The image must be grey or BGR. What
  /// is returned throws as `frame`, keeps what it needs but for the image, and is thread safe.
  std::function<GreyImage(const StillPose&)> resized(const Placement& placement) const;

  /// What each pixel of that frame shows: [y, x] of size(), 0 the image, else 1 + the box of the
  /// object. Empty if there is nothing but the image.
  std::vector<std::uint16_t> seen(const StillPose& pose) const;

  /// Where what lies at a point of the frame at `from` lies in the frame at `to`, if it is what
  /// `seen` calls `number`.
  AffineMap step(const StillPose& from, const StillPose& to, std::size_t number) const;

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
