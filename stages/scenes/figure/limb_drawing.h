#pragma once

#include <cstddef>
#include <vector>

#include "manifests/image_size.h"
#include "manifests/labels.h"
#include "stages/scenes/figure/figure.h"
#include "stages/scenes/picture.h"
#include "stages/scenes/texture.h"

namespace eventgan {

/// A limb as a picture shows it: the pixels within `radius` of a line.
struct DrawnLimb {
  Point from;
  Point to;
  double radius = 0;  ///< px
  double depth = 0;   ///< mean distance of its ends from the camera, mm
};

DrawnLimb drawn_limb(const Limb3d& limb, const Intrinsics& camera);

/// Where a point lies beside a limb: how far along its line (0..1) and how far off it (px).
struct LimbPlace {
  double along = 0;
  double distance = 0;
};

LimbPlace place_on(const DrawnLimb& limb, const Point& point);

/// The rectangle around a drawn limb, edges in px.
Rectangle bounds_of(const DrawnLimb& limb);

/// Paints a limb with a pattern that is fixed to it and an edge softened over one pixel onto
/// `canvas`, and notes `object` where it covers a pixel's centre.
void draw_limb(const Limb3d& limb, const Intrinsics& camera, const Texture& texture, int object,
               ImageSize size, std::vector<Colour>& canvas, std::vector<int>& objects);

}  // namespace eventgan
