#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/placement.h"
#include "stages/base/images/image_file.h"

namespace eventgan {

/// Of a plan's fingerprint: another one wherever stills' frames would have other pixels.
inline constexpr const char* kStillSampling =
    "in the volume's size, bicubic; JPEGs at 1/2, 1/4, 1/8 where that is twice as much";

using SharedImage = std::shared_ptr<const ColourFrame>;

/// An image that pairs are made of, whole or reduced (decode_image): motions, labels, and places
/// are those of the whole image.
struct StillImage {
  SharedImage pixels;
  ImageSize size;  ///< of the whole image
  int reduced_by = 1;

  StillImage(SharedImage image) : pixels(std::move(image)), size(pixels->size) {}
  StillImage(SharedImage image, ImageSize whole, int by)
      : pixels(std::move(image)), size(whole), reduced_by(by) {}
};

/// By how much, 8, 4, 2 or 1, the still of a pair with a motion is to be reduced: its sides are
/// multiples of that, and on either axis it keeps two pixels for each that the volume shows, so
/// that its frames are as sharp as a smaller photograph's. Throws as MovingStill. Thread safe.
int still_reduction(ImageSize whole, const ImageSpec& spec, const FramePair& pair);

/// A still whose image and objects move, taken apart (detail/still_layers.h) once for its pair
/// (FramePair::motion), or for all pairs of a clip that is made of it (FramePair::poses).
///
/// The labelled frame of a pair with a motion is the image itself, prepared as prepare_frame does;
/// of a reduced image it is sampled as all others. All other frames, of clips all, are sampled in
/// the volume's size (detail/scaled_layers.h), bicubic (Keys with a = -0.75): the image where
/// moved_to_labelled leads, or image_in_clip back; before it objects that move on their own
/// (FramePair::objects) where object_to_labelled leads, or object_in_clip back, the farther ones
/// first; what they uncover is filled. Where grey is made before resizing the grey image is moved.
/// Of a pair the borders that only one of both images shows are left out (placement.h); of a clip,
/// frames are what its window shows. Thread safe.
class MovingStill {
 public:
  /// `boxes`: of the still; those without an outline do not move on their own. Of a clip, `pair` is
  /// any one. Throws std::runtime_error "expected X, got Y" if the image cannot be placed, resized,
  /// or moved, if a side is beyond 32,766 pixels, if too little of it would be left, and of a clip
  /// if it is reduced.
  MovingStill(StillImage image, const FramePair& pair, const ImageSpec& spec,
              const std::vector<Box>& boxes = {});

  const Placement& placement() const;

  /// Both frames, u = 0 and 1, and what is between them: image and objects move steadily from one
  /// to the other (manifests/values/still_motion.h). `pair`: the one it was made of, or one of the
  /// same clip, with both of its poses. It keeps what it needs of this. Throws as above, also when
  /// asked for a frame.
  FramesBetween frames(const FramePair& pair) const;

  /// For each pixel of the volume the motion of the image, or of the object that covers at least
  /// half of the labelled frame's pixel there, by the maps that make the frames, whatever the
  /// placement. Valid where the same thing is seen at the place in the other frame to which it
  /// leads, between the outermost pixels' centres of what the volume shows. Throws as above.
  PixelFlow flow(const FramePair& pair) const;

 private:
  struct State;
  std::shared_ptr<const State> state_;
};

/// The moved frame of a still's pair, of the image's size and in colour, for looking at: as
/// MovingStill's but for rounding, of the whole image. Places beyond the image take its nearest
/// pixel, for `place` to cut away. Throws as MovingStill. Thread safe.
ColourFrame move_still(const ColourFrame& image, const FramePair& pair,
                       const std::vector<Box>& boxes = {});

}  // namespace eventgan
