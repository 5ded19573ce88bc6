#include "manifests/values/sensor_input.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace eventgan {
namespace {

constexpr int kLevels = 256;

std::array<float, kLevels> log_intensities() {
  std::array<float, kLevels> logs;
  for (int u = 0; u < kLevels; ++u) {
    logs[static_cast<std::size_t>(u)] = static_cast<float>(std::log(u / 255.0 + kFrameLogEpsilon));
  }
  return logs;
}

}  // namespace

std::vector<float> sensor_input(std::span<const float> frames, const ContrastThreshold& threshold) {
  static const std::array<float, kLevels> logs = log_intensities();
  const auto rise = static_cast<float>(1 / (threshold.positive() * kMostThresholds));
  const auto fall = static_cast<float>(1 / (threshold.negative() * kMostThresholds));
  const auto log_of = [](float x) {
    const float u = std::clamp((x + 1) * 127.5f, 0.0f, 255.0f);
    return u >= 0 ? logs[static_cast<std::size_t>(u + 0.5f)] : x;  // false for NaN
  };
  const std::size_t pixels = frames.size() / 2;
  std::vector<float> planes(3 * pixels);
  std::ranges::copy(frames, planes.begin());
  for (std::size_t i = 0; i < pixels; ++i) {
    const float change = log_of(frames[pixels + i]) - log_of(frames[i]);
    planes[2 * pixels + i] = std::clamp(change * (change > 0 ? rise : fall), -1.0f, 1.0f);
  }
  return planes;
}

}  // namespace eventgan
