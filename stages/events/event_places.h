#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/labels.h"

namespace eventgan {

// Where and when a volume [2 bins, y, x], float32, C order, has its events. All thread safe.

/// The sum over the pixels, channel by channel.
std::vector<double> channel_sums(std::span<const float> volume, const VolumeShape& shape);

/// [y, x] 1 where a pixel's values sum to `least` or more over all channels, else 0.
std::vector<std::uint8_t> event_mask(std::span<const float> volume, const VolumeShape& shape,
                                     double least);

/// The share of a box's pixels that are set in a mask [y, x]; a pixel belongs to the box that its
/// centre lies in. None for a box without pixels.
std::optional<double> share_inside(std::span<const std::uint8_t> mask, ImageSize size,
                                   const Rectangle& box);

/// Whether a pixel of the mask is set in the square that reaches `radius` pixels from that of
/// `point`. None for a point outside the mask.
std::optional<bool> is_set_near(std::span<const std::uint8_t> mask, ImageSize size, Point point,
                                int radius);

}  // namespace eventgan
