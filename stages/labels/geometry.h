#pragma once

#include "manifests/labels.h"
#include "manifests/placement.h"

namespace eventgan {

/// Source pixels to volume pixels and back, by the equations in manifests/placement.h. Pure
/// functions.
Point to_volume(const Placement& placement, Point point);
Point to_source(const Placement& placement, Point point);
Rectangle to_volume(const Placement& placement, const Rectangle& box);
Rectangle to_source(const Placement& placement, const Rectangle& box);

/// Focal lengths scale, the principal point maps as a point.
Intrinsics to_volume(const Placement& placement, const Intrinsics& camera);

/// `box` cut to [0, width] x [0, height]; a box wholly outside becomes empty (zero width or height)
/// at the border nearest to it, never inside out.
Rectangle clip(const Rectangle& box, ImageSize size);

/// True if the rectangle has no area.
bool is_empty(const Rectangle& box);

}  // namespace eventgan
