#pragma once

#include <cstdint>
#include <span>

#include "manifests/values/events.h"

namespace eventgan {

/// Whether a volume shows the true direction of motion. The average-timestamp image T (both
/// polarities together) rises in the direction of motion; the flow v with ∇T · v = 1 fitted by
/// least squares over a window around the pixel, where events lie, is compared with the true flow.
///
/// Each slope has the weight 1/|∇T|: steep ones are mostly steps from the time of one contour to
/// that of another, flat ones mostly noise, and this is between the fit in time (weight 1) and
/// that in distance (1/|∇T|²).
struct DirectionScore {
  std::int64_t pixels = 0;  ///< event pixels whose true flow is ≥ min_flow_px and whose window
                            ///< determines both components of v
  std::int64_t within = 0;  ///< of these, where the angle to the true flow is ≤ tolerance_deg
  double fraction() const { return pixels > 0 ? static_cast<double>(within) / pixels : 0; }
};

struct DirectionSettings {
  double min_flow_px = 1;
  double tolerance_deg = 30;
  int window = 21;          ///< side in pixels, odd; over smaller ones the errors of T dominate
  double min_events = 0.1;  ///< an event pixel's least Σ V̂ (see realism_scores.h); below it is the
                            ///< faint noise of a network, whose T is as large as an event's
  int min_slopes = 8;  ///< least number of pixels in the window where ∇T is known
  double min_roundness =
      0.05;  ///< least ratio of the eigenvalues of Σ ∇T ∇Tᵀ/|∇T| over the
             ///< window, smaller to larger: 0 is a straight edge (aperture problem)
};

/// volume: [2 bins, y, x] float32, ≥ 0, normalised as for realism_scores. flow_x, flow_y: [y, x]
/// displacement over the pair, px; where they are not finite the true flow is unknown and the pixel
/// does not count. Throws std::invalid_argument if sizes differ, the window is even, or a volume's
/// value is NaN, infinite or below zero. Thread safe.
DirectionScore motion_direction(std::span<const float> volume, const VolumeShape& shape,
                                std::span<const float> flow_x, std::span<const float> flow_y,
                                const DirectionSettings& settings = {});

}  // namespace eventgan
