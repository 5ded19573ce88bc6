#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "stages/scenes/figure/figure.h"
#include "stages/scenes/figure/figure_scene.h"

namespace eventgan {

/// A figure whose place, heading and gait are drawn from the seed, such that it stays in the
/// picture of `figure_camera` for the frames -10..20 and moves by 1 to 3 px a frame on average.
FigureMotion cast_figure(std::uint64_t seed, std::string_view role);

/// The same figure seen by a camera that stands elsewhere, turned by `angle` (rad) around the
/// vertical line through `pivot`.
FigureMotion seen_from(const FigureMotion& motion, const Vector3& pivot, double angle);

}  // namespace eventgan
