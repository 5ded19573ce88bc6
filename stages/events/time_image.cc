#include "stages/events/time_image.h"

namespace eventgan {
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
