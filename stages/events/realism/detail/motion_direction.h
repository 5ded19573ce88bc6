#pragma once

#include <opencv2/core.hpp>
#include <span>

#include "manifests/values/events.h"

namespace eventgan {

/// The average-timestamp image of both polarities together, T = Σ_b τ_b V_b / Σ_b V_b with τ in
/// [0, 1], at the pixels that have events, and its slope there. All [y, x].
struct TimeSlope {
  cv::Mat1b event;  ///< 255 where the pixel has events, else 0
  cv::Mat1b known;  ///< 255 where ∇T is known: an event pixel with an event neighbour in x and in y
  cv::Mat1d x;      ///< ∂T/∂x per pixel, 0 where not known
  cv::Mat1d y;      ///< ∂T/∂y
};

/// A pixel has events where Σ_b V_b ≥ min_events. The slope is the central difference where both
/// neighbours have events, else the difference to the one that has.
TimeSlope time_slope(std::span<const float> volume, const VolumeShape& shape, double min_events);

}  // namespace eventgan
