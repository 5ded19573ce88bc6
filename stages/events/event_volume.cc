#include "stages/events/event_volume.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <stdexcept>
#include <string>
#include <utility>

namespace eventgan {
namespace {

[[noreturn]] void refuse_event(const Event& event, std::size_t number,
                               const std::string& expected) {
  throw std::invalid_argument("expected " + expected + ", got x=" + std::to_string(event.x) +
                              " y=" + std::to_string(event.y) + " t=" + std::to_string(event.t_s) +
                              " as event " + std::to_string(number));
}

inline void check_event(const Event& event, std::size_t number, ImageSize size) {
  const bool inside = event.x >= 0 && event.x < size.width && event.y >= 0 && event.y < size.height;
  if (!inside || !std::isfinite(event.t_s)) {
    refuse_event(event, number,
                 "an event with a finite time inside " + to_string(size) + " pixels");
  }
}

void check_order(std::span<const Event> events, const std::array<double, 2>& times_s) {
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
}

void check_span(const std::array<double, 2>& times_s, int last_bin) {
  // Beyond it the scaled times below are infinite.
  if (!std::isfinite(last_bin * (times_s[1] - times_s[0]))) {
    throw std::invalid_argument("expected times whose differences are finite, got t=" +
                                std::to_string(times_s[0]) + " to " + std::to_string(times_s[1]));
  }
}

/// Adds an event at t* to its bin and the one above it; the bins of its pixel and polarity lie
/// `stride` apart.
void add_event(double star, int last_bin, double* bins, std::size_t stride) {
  // Rounding may carry t* of the last event past the last bin, for which there is no plane.
  const int bin = std::min(static_cast<int>(star), last_bin);
  const double above = star - bin;
  double* place = bins + static_cast<std::size_t>(bin) * stride;
  place[0] += 1 - above;
  if (above > 0) place[stride] += above;
}

/// t* of times from t_1 to t_N.
struct ScaledTime {
  double first_s;
  double duration_s;
  int last_bin;

  double star(double t_s) const {
    return duration_s > 0
               ? std::clamp(last_bin * (t_s - first_s) / duration_s, 0.0, double(last_bin))
               : 0.0;
  }
};

}  // namespace

void check_events(std::span<const Event> events, ImageSize size,
                  const std::array<double, 2>& times_s) {
  if (events.empty()) return;
  for (std::size_t i = 0; i < events.size(); ++i) check_event(events[i], i, size);
  check_order(events, times_s);
  check_span(times_s, 1);
}

std::vector<float> event_volume(std::span<const Event> events, const VolumeShape& shape,
                                std::optional<std::array<double, 2>> times_s) {
  // In double: a sum of ones in float32 stays at 2^24.
  std::vector<double> volume(shape.value_count(), 0.0);
  if (events.empty()) return {volume.begin(), volume.end()};

  const std::size_t plane = shape.size.pixel_count();
  const auto [first, last] = times_s.value_or(std::array{events.front().t_s, events.back().t_s});
  const int last_bin = shape.bins - 1;
  check_events(events, shape.size, {first, last});
  check_span({first, last}, last_bin);
  const ScaledTime time{first, last - first, last_bin};
  for (const Event& event : events) {
    double* pixel = volume.data() + (event.positive ? 0 : shape.bins * plane) +
                    static_cast<std::size_t>(event.y) * shape.size.width + event.x;
    add_event(time.star(event.t_s), last_bin, pixel, plane);
  }
  return {volume.begin(), volume.end()};
}

void pixel_event_volume(std::span<const Event> events, const VolumeShape& shape,
                        std::span<float> volume) {
  if (events.empty()) {
    std::ranges::fill(volume, 0.0f);
    return;
  }

  double first = events.front().t_s;
  double last = first;
  check_event(events.front(), 0, shape.size);
  for (std::size_t i = 1; i < events.size(); ++i) {
    const Event& before = events[i - 1];
    const Event& event = events[i];
    check_event(event, i, shape.size);
    const bool same_pixel = event.y == before.y && event.x == before.x;
    const bool ordered = same_pixel
                             ? event.t_s >= before.t_s
                             : event.y > before.y || (event.y == before.y && event.x > before.x);
    if (!ordered) {
      refuse_event(event, i, "events pixel by pixel, each pixel's in time order");
    }
    first = std::min(first, event.t_s);
    last = std::max(last, event.t_s);
  }
  check_span({first, last}, shape.bins - 1);

  const ScaledTime time{first, last - first, shape.bins - 1};
  const auto channels = static_cast<std::size_t>(shape.channels());
  const std::size_t plane = shape.size.pixel_count();
  constexpr std::size_t kBlock = 128;            // pixels whose sums the cache holds
  std::vector<double> block(channels * kBlock);  // [channel, pixel]
  const std::size_t negative = channels / 2 * kBlock;
  auto event = events.begin();
  for (std::size_t start = 0; start < plane; start += kBlock) {
    const std::size_t count = std::min(kBlock, plane - start);
    std::ranges::fill(block, 0.0);
    for (; event != events.end(); ++event) {
      const std::size_t place = pixel_of(*event, shape.size) - start;
      if (place >= count) break;
      add_event(time.star(event->t_s), time.last_bin,
                block.data() + (event->positive ? 0 : negative) + place, kBlock);
    }
    for (std::size_t channel = 0; channel < channels; ++channel) {
      std::ranges::transform(std::span(block).subspan(channel * kBlock, count),
                             volume.subspan(channel * plane + start).begin(),
                             [](double sum) { return static_cast<float>(sum); });
    }
  }
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
