#pragma once

#include <opencv2/core.hpp>
#include <span>

#include "manifests/values/events.h"

namespace eventgan {

/// Colour of a mean time (0.1 first bin .. 1 last bin, clamped) at full brightness: blue, cyan,
/// green, yellow, red.
cv::Vec3b time_colour(float time);

/// The average-timestamp image of a volume [2 bins, y, x] as CV_8UC3 of the volume's size,
/// coloured as draw_preview says. Pixels with a value that is not finite are white.
cv::Mat time_panel(std::span<const float> volume, const VolumeShape& shape);

/// Its polarities likewise: red where positive events are, blue where negative ones, between them
/// their mixture, on white; as strong as the times are bright. Pixels with a value that is not
/// finite are black.
cv::Mat polarity_panel(std::span<const float> volume, const VolumeShape& shape);

}  // namespace eventgan
