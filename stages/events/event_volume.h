#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/placement.h"

namespace eventgan {

/// V(x,y,b) = Σ_i max(0, 1 - |b - t*_i|), t*_i = (B-1)(t_i - t_1)/(t_N - t_1), per polarity, as
/// EventGAN has it; [2 bins, H, W] float32, C order; sums are formed in double. t_1 and t_N are
/// `times_s`, or without them the times of the first and the last event. No events → zeros; t_N =
/// t_1 → t* = 0. Throws std::invalid_argument for an event outside the image or the times, a time
/// that is not finite, events that are not in time order, or times so far apart (1e307) that
/// (B-1)(t_N - t_1) is not finite. Thread safe.
std::vector<float> event_volume(std::span<const Event> events, const VolumeShape& shape,
                                std::optional<std::array<double, 2>> times_s = std::nullopt);

/// The place of an event's pixel in an image [y, x], which it lies in.
inline std::size_t pixel_of(const Event& event, ImageSize size) {
  return static_cast<std::size_t>(event.y) * static_cast<std::size_t>(size.width) +
         static_cast<std::size_t>(event.x);
}

/// Throws std::invalid_argument for events that event_volume does not take; `times_s` are t_1 and
/// t_N. Thread safe.
void check_events(std::span<const Event> events, ImageSize size,
                  const std::array<double, 2>& times_s);

/// The same volume of events that come pixel by pixel in C order, each pixel's in time order, as
/// pixel_events gives them: t_1 and t_N are the earliest and the latest time. Written to
/// `volume`, shape.value_count() values. Throws std::invalid_argument as above. Thread safe.
void pixel_event_volume(std::span<const Event> events, const VolumeShape& shape,
                        std::span<float> volume);

/// Takes events of an image into the volume that it is placed in: an event comes to the pixel that
/// the centre of its own falls in, x' = floor((x + 0.5) s) + offset, whatever `s`; none is added or
/// spread. Those that a crop cuts away are removed. Order and times stay. Thread safe.
void place_events(const Placement& placement, std::vector<Event>& events);

/// The average-timestamp image of the paper, per polarity: at each pixel the mean of the bins'
/// times τ_b = 0.1 + 0.9 b/(B-1), weighted by the volume: T(x,y) = Σ_b τ_b V_b / (Σ_b V_b + 1e-5);
/// 0 without events. The published image is (positive + negative)/2.
struct TimeImage {
  ImageSize size;
  std::vector<float> positive;  ///< [y, x] in [0, 1]
  std::vector<float> negative;  ///< [y, x] in [0, 1]
};

/// volume: [2 bins, H, W] float32, ≥ 0, C order. B = 1 has τ = 0.1. Thread safe.
TimeImage time_image(std::span<const float> volume, const VolumeShape& shape);

}  // namespace eventgan
