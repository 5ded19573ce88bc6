#include "stages/events/event_volume.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <stdexcept>
#include <string>

namespace eventgan {
namespace {

void check_event(const Event& event, std::size_t number, const VolumeShape& shape) {
  const bool inside =
      event.x >= 0 && event.x < shape.size.width && event.y >= 0 && event.y < shape.size.height;
  if (!inside || !std::isfinite(event.t_s)) {
    throw std::invalid_argument(
        "expected an event with a finite time inside " + to_string(shape.size) +
        " pixels, got x=" + std::to_string(event.x) + " y=" + std::to_string(event.y) +
        " t=" + std::to_string(event.t_s) + " as event " + std::to_string(number));
  }
}

void check_times(std::span<const Event> events, const std::array<double, 2>& times_s,
                 int last_bin) {
  const auto unsorted = std::ranges::is_sorted_until(events, {}, &Event::t_s);
  if (unsorted != events.end()) {
    throw std::invalid_argument(
        "expected events in time order, got t=" + std::to_string(unsorted->t_s) +
        " after t=" + std::to_string(std::prev(unsorted)->t_s) + " as event " +
        std::to_string(unsorted - events.begin()));
  }
  if (!(times_s[0] <= events.front().t_s && events.back().t_s <= times_s[1])) {
    throw std::invalid_argument("expected events from t=" + std::to_string(times_s[0]) + " to " +
                                std::to_string(times_s[1]) +
                                ", got t=" + std::to_string(events.front().t_s) + " to " +
                                std::to_string(events.back().t_s));
  }
  // Beyond it the scaled times below are infinite.
  if (!std::isfinite(last_bin * (times_s[1] - times_s[0]))) {
    throw std::invalid_argument("expected times whose differences are finite, got t=" +
                                std::to_string(times_s[0]) + " to " + std::to_string(times_s[1]));
  }
}

}  // namespace

std::vector<float> event_volume(std::span<const Event> events, const VolumeShape& shape,
                                std::optional<std::array<double, 2>> times_s) {
  // In double: a sum of ones in float32 stays at 2^24.
  std::vector<double> volume(shape.value_count(), 0.0);
  if (events.empty()) return {volume.begin(), volume.end()};

  const std::size_t plane = shape.size.pixel_count();
  const auto [first, last] = times_s.value_or(std::array{events.front().t_s, events.back().t_s});
  const double duration = last - first;
  const int last_bin = shape.bins - 1;
  for (std::size_t i = 0; i < events.size(); ++i) check_event(events[i], i, shape);
  check_times(events, {first, last}, last_bin);
  for (const Event& event : events) {
    const double star =
        duration > 0 ? std::clamp(last_bin * (event.t_s - first) / duration, 0.0, double(last_bin))
                     : 0.0;
    // Rounding may carry t* of the last event past the last bin, for which there is no plane.
    const int bin = std::min(static_cast<int>(star), last_bin);
    const double above = star - bin;
    double* pixel = volume.data() + (event.positive ? 0 : shape.bins * plane) + bin * plane +
                    static_cast<std::size_t>(event.y) * shape.size.width + event.x;
    pixel[0] += 1 - above;
    if (above > 0) pixel[plane] += above;
  }
  return {volume.begin(), volume.end()};
}

namespace {

/// floor((place + 0.5) scaled / source) in whole numbers.
int scaled_place(int place, int source, int scaled) {
  return static_cast<int>((2 * std::int64_t{place} + 1) * scaled / (2 * std::int64_t{source}));
}

}  // namespace

void place_events(const Placement& placement, std::vector<Event>& events) {
  const ImageSize source = placement.source;
  const ImageSize scaled = placement.scaled;
  for (Event& event : events) {
    event.x = scaled_place(event.x, source.width, scaled.width) + placement.offset_x;
    event.y = scaled_place(event.y, source.height, scaled.height) + placement.offset_y;
  }
  std::erase_if(events, [&](const Event& event) {
    return event.x < 0 || event.x >= placement.volume.width || event.y < 0 ||
           event.y >= placement.volume.height;
  });
}

namespace {

constexpr float kFirstTime = 0.1f;
constexpr float kLastTime = 1.0f;
constexpr float kNoEvents = 1e-5f;  // the published code's guard against dividing by zero

std::vector<float> mean_times(std::span<const float> polarity, int bins, std::size_t plane) {
  std::vector<float> weighted(plane, 0.0f);
  std::vector<float> mass(plane, kNoEvents);
  for (int bin = 0; bin < bins; ++bin) {
    const float time =
        bins == 1 ? kFirstTime : kFirstTime + (kLastTime - kFirstTime) * bin / (bins - 1);
    const float* values = polarity.data() + bin * plane;
    for (std::size_t i = 0; i < plane; ++i) {
      weighted[i] += time * values[i];
      mass[i] += values[i];
    }
  }
  for (std::size_t i = 0; i < plane; ++i) weighted[i] /= mass[i];
  return weighted;
}

}  // namespace

TimeImage time_image(std::span<const float> volume, const VolumeShape& shape) {
  const std::size_t plane = shape.size.pixel_count();
  const std::size_t half = shape.bins * plane;
  return {shape.size, mean_times(volume.first(half), shape.bins, plane),
          mean_times(volume.subspan(half, half), shape.bins, plane)};
}

}  // namespace eventgan
