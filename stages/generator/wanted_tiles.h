#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "manifests/values/job.h"
#include "manifests/values/labels.h"
#include "manifests/values/tiles.h"

namespace eventgan {

/// Which tiles of a volume a scope wants, not kWhole. `frames` [2, y, x] in [-1, 1] are the
/// `content` of a volume, whose first pixel stands at (content_y, content_x); the tiles lie on the
/// volume's grid, `labels` are in its pixels.
///
/// Motion: pixels whose two values differ by more than `motion_threshold` grey levels (127.5 |x_1 -
/// x_0|), or are not finite, and what lies within `motion_margin_px` rows and columns of them.
/// Labels: boxes that are not to be ignored, and of persons the square of 1.25 x 200 x scale about
/// their centre, as pose trainers cut them out, or where there is no such thing their joints'
/// bounding box; each with `label_margin_px` around it. Pure.
TileMask wanted_tiles(const ScopeSpec& scope, std::span<const float> frames, ImageSize content,
                      int content_y, int content_x, const VolumeLabels& labels);

/// The tiles of the whole volume, [row, column], of which `wanted` are those of the content.
std::vector<std::uint8_t> tiles_of_volume(const TileMask& wanted, int content_y, int content_x,
                                          ImageSize volume);

}  // namespace eventgan
