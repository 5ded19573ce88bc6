#include "stages/scenes/figure/limb_drawing.h"

#include <algorithm>
#include <cmath>

#include "stages/scenes/camera.h"

namespace eventgan {

DrawnLimb drawn_limb(const Limb3d& limb, const Intrinsics& camera) {
  const double depth = (limb.from.z + limb.to.z) / 2;
  return {project(camera, limb.from), project(camera, limb.to),
          limb.radius * camera.focal_x / depth, depth};
}

LimbPlace place_on(const DrawnLimb& limb, const Point& point) {
  const double x = limb.to.x - limb.from.x;
  const double y = limb.to.y - limb.from.y;
  const double square = x * x + y * y;
  const double share =
      square == 0 ? 0 : ((point.x - limb.from.x) * x + (point.y - limb.from.y) * y) / square;
  const double along = std::clamp(share, 0.0, 1.0);
  return {along, std::hypot(point.x - limb.from.x - along * x, point.y - limb.from.y - along * y)};
}

Rectangle bounds_of(const DrawnLimb& limb) {
  // Half a pixel, since edges lie between pixels and points on their centres.
  return {std::min(limb.from.x, limb.to.x) - limb.radius + 0.5,
          std::min(limb.from.y, limb.to.y) - limb.radius + 0.5,
          std::max(limb.from.x, limb.to.x) + limb.radius + 0.5,
          std::max(limb.from.y, limb.to.y) + limb.radius + 0.5};
}

void draw_limb(const Limb3d& limb, const Intrinsics& camera, const Texture& texture, int object,
               ImageSize size, std::vector<Colour>& canvas, std::vector<int>& objects) {
  const DrawnLimb drawn = drawn_limb(limb, camera);
  const Rectangle bounds = bounds_of(drawn);
  const double limb_mm = length(limb.to - limb.from);
  const int left = std::max(0, static_cast<int>(bounds.left) - 1);
  const int right = std::min(size.width - 1, static_cast<int>(bounds.right) + 1);
  const int top = std::max(0, static_cast<int>(bounds.top) - 1);
  const int bottom = std::min(size.height - 1, static_cast<int>(bounds.bottom) + 1);
  for (int y = top; y <= bottom; ++y) {
    for (int x = left; x <= right; ++x) {
      const LimbPlace place = place_on(drawn, {static_cast<double>(x), static_cast<double>(y)});
      const double cover = std::clamp(drawn.radius - place.distance + 0.5, 0.0, 1.0);
      if (cover <= 0) continue;
      const double across = place.distance / drawn.radius;  // 0 on the line, 1 at the edge
      const float roundness = static_cast<float>(1.0 - 0.35 * across * across);
      const float pattern =
          0.75f + 0.5f * texture.noise(place.along * limb_mm / 45, across * 2.5 + limb.radius);
      const std::size_t pixel = static_cast<std::size_t>(y) * size.width + x;
      canvas[pixel] =
          mix(canvas[pixel], limb.colour * (roundness * pattern), static_cast<float>(cover));
      if (place.distance <= drawn.radius) objects[pixel] = object;
    }
  }
}

}  // namespace eventgan
