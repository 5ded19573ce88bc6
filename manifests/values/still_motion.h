#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/frames.h"
#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/pair_key.h"

namespace eventgan {

/// An affine map of points, row-major [2][3], pixel centres being integers:
/// x' = m0 x + m1 y + m2, y' = m3 x + m4 y + m5.
using AffineMap = std::array<double, 6>;

/// The motion about `centre` as a map; at u of its time, where shift and angle are u times as large
/// and the scale is its u-th power. u = 0: nothing moves.
AffineMap map_of(const ImageMotion& motion, Point centre, double u = 1);

/// second(first(x)).
AffineMap compose(const AffineMap& second, const AffineMap& first);

/// Throws std::invalid_argument if it has none.
AffineMap inverse(const AffineMap& map);

inline Point mapped(const AffineMap& map, Point point) {
  return {map[0] * point.x + map[1] * point.y + map[2],
          map[3] * point.x + map[4] * point.y + map[5]};
}

/// Of a place as edges are counted, which lie half a pixel before the centre of the pixel with
/// their number.
Point mapped_edge(const AffineMap& map, Point edge);

/// Of a still's pair, which has a motion: where a point of the frame at u of the time from the
/// previous frame (0) to the next (1) lies in the labelled image. A point of an object moves as
/// next = image's motion(object's motion(previous)), both about centres in the labelled image.
/// Where u is label_position, it is where it lies.
AffineMap image_to_labelled(ImageSize source, const FramePair& pair, double u);
AffineMap object_to_labelled(ImageSize source, const FramePair& pair, const ImageMotion& object,
                             const Box& box, double u);

/// The part of a still that the frames of its clip show: without an eighth of it on each side.
struct ClipWindow {
  int x = 0;
  int y = 0;
  ImageSize size;
};
ClipWindow clip_window(ImageSize image);

/// Where a point of the still lies in a frame of its clip, as part of the image or of the object of
/// a box; in pixels of the whole image, of which the frame is clip_window.
AffineMap image_in_clip(ImageSize image, const StillPose& pose);
AffineMap object_in_clip(ImageSize image, const StillPose& pose, const ImageMotion& object,
                         const Box& box);

/// The pose at u of the time from one frame to the next.
StillPose pose_between(const StillPose& from, const StillPose& to, double u);

/// Whether the object of a box can move on its own: it has an outline, and is not to be ignored.
bool moves_alone(const Box& box);

/// With which object of a clip each one moves: with a larger one, in whose box at least half of its
/// own lies, as a rider with his horse and a bag with who carries it, unless it stands before that
/// one (narrow beside it, and down to its foot); with one of its own class only if nearly all of
/// its box lies in that one's and half of its outline is that one's, too, since people in a crowd
/// walk apart; else with itself. Of those that move with others the last one. Pure.
std::vector<std::size_t> carriers(const std::vector<Box>& boxes);

/// The poses of a still's clip, `frames` + 1 of them; the first is the still itself. Speeds are
/// drawn as the motions of single pairs are; directions change slowly, and now and then a thing
/// pauses. The image stays where clip_window sees nothing beyond it. An object moves by a quarter
/// of its size a frame at most (the root of its box's area), and as its carrier does, one of
/// `carriers`. An outline that holds no pixel's centre in the image is part of it. Pure.
std::vector<StillPose> clip_poses(const StillsSpec& spec, const CounterRandom& still,
                                  const std::vector<Box>& boxes,
                                  const std::vector<std::size_t>& carriers, ImageSize image,
                                  int frames);

/// The image's motion of a still's pair; none at all (the identity) of as many as `spec` lets rest.
/// The seed draws each number on its own, so that the limits of one do not change the others.
ImageMotion draw_motion(const StillsSpec& spec, const CounterRandom& pair);

/// Gives a planned still what its labels decide: FramePair::objects, of boxes whose outline or, to
/// cut one out of, whose area holds a pixel's centre in the image, and are not to be ignored; and
/// to an image that was to rest, if no object moves before it, the motion that it would have had,
/// since a sensor would see nothing. `image`: its size; not known, it has every pixel, and the
/// motion may be settled again once it is. Pure; does nothing to other pairs.
void settle_motion(const PairSpec& spec, const PairKey& key, const std::vector<Box>& boxes,
                   const std::optional<ImageSize>& image, FramePair& pair);

}  // namespace eventgan
