#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/tiles.h"

namespace eventgan {

/// The smallest rectangle that holds every square that a pose trainer cuts out around a person by
/// default, in volume pixels: PoseDataset of the Python package, and Microsoft's Simple Baselines.
/// Their side is 200 x scale, for MPII's persons (there for all) with the scale enlarged by 1.25
/// and the centre moved down by 15 x scale. Augmentation enlarges the side by up to 1.25 and turns
/// the square by up to 60 degrees, so that it reaches 100 x 1.25 x 1.25 x sqrt(2) x scale from the
/// moved centre, to all four sides. A person without centre or scale has those of the bounding box
/// of its joints, enlarged by 1.25; then the rectangle holds the squares of all joints and of any
/// part of them. Edges are points, the outermost that are sampled; left > right if nothing is
/// annotated. Pure.
Rectangle pose_crop(const VolumePerson& person);

/// The rule of wanted_tiles for what moves, for fingerprints: other rules mark other tiles.
inline constexpr const char* kMotionRule = "difference, smoothed over 3x3 pixels";

/// Which tiles of a volume a scope wants, not kWhole. `frames` [2, y, x] in [-1, 1] are the
/// `content` of a volume, whose first pixel is at (content_y, content_x); the tiles lie on the
/// volume's grid, `labels` are in its pixels.
///
/// Motion: pixels at which the frames' difference, smoothed by the binomial kernel (1 2 1) / 4
/// along both axes with the border repeated, exceeds `motion_threshold` grey levels (127.5 |x_1 -
/// x_0|) or is not finite, and what lies within `motion_margin_px` rows and columns of them.
/// Smoothing leaves 3/8 of noise that is independent from pixel to pixel, more of a codec's, and
/// most of an edge. Labels: boxes that are not to be ignored, and of persons all that pose trainers
/// may cut out (pose_crop); each with `label_margin_px` around it. Pure.
TileMask wanted_tiles(const ScopeSpec& scope, std::span<const float> frames, ImageSize content,
                      int content_y, int content_x, const VolumeLabels& labels);

/// The tiles of the whole volume, [row, column], of which `wanted` are those of the content.
std::vector<std::uint8_t> tiles_of_volume(const TileMask& wanted, int content_y, int content_x,
                                          ImageSize volume);

}  // namespace eventgan
