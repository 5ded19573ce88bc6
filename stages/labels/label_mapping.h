#pragma once

#include <array>
#include <string>

#include "manifests/values/faults.h"
#include "manifests/values/labels.h"
#include "manifests/values/placement.h"

namespace eventgan {

/// Source pixels to volume pixels and back, by the equations in manifests/values/placement.h. Pure
/// functions.
Point to_volume(const Placement& placement, Point point);
Point to_source(const Placement& placement, Point point);
Rectangle to_volume(const Placement& placement, const Rectangle& box);
Rectangle to_source(const Placement& placement, const Rectangle& box);
Outline to_volume(const Placement& placement, const Outline& outline);

/// Focal lengths scale, the principal point maps as a point.
Intrinsics to_volume(const Placement& placement, const Intrinsics& camera);

/// A camera's P [3][4], so that w [x', y', 1] = P' [X, Y, Z, 1]: its rows are combined as the map
/// of points combines x, y and 1.
std::array<double, 12> to_volume(const Placement& placement,
                                 const std::array<double, 12>& projection);

/// `box` cut to `area`; a box wholly outside becomes empty (zero width or height) at the border
/// nearest to it, never inside out.
Rectangle clip(const Rectangle& box, const Rectangle& area);

/// `outline` cut to `area`: within it the same places are covered, and no corner is outside. What
/// is cut off leaves edges along the border that enclose nothing; rings wholly outside are left
/// out.
Outline clip(const Outline& outline, const Rectangle& area);

/// True if the rectangle has no area.
bool is_empty(const Rectangle& box);

/// Maps every label into the volume; boxes are clipped to what it shows of the image (not to a
/// letterbox's borders), outlines are not. A box is to be ignored, too, if nothing of it or of its
/// outline is left. A fault if a label cannot belong to the image: a place, a
/// camera or a scale beyond 1e6 (px), another number that is not finite (a joint in 3-D may be
/// unknown), a projection that is not in the volume, a box with right < left or bottom < top or
/// without any overlap with the source image (a box to ignore may lie anywhere within those 1e6
/// px) or whose outline lies apart from it, a person whose annotated joints all lie outside it.
/// `where` names the annotation in the fault.
Outcome<VolumeLabels> map_labels(const Annotation& annotation, const Placement& placement,
                                 const std::string& where);

}  // namespace eventgan
