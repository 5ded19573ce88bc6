#include "pipeline/realism/flow_path.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace eventgan {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

/// Bilinear; NaN outside the pixels' centres, and where a neighbour that counts is NaN.
float value_at(const std::vector<float>& values, ImageSize size, float x, float y) {
  const auto right = static_cast<float>(size.width - 1);
  const auto bottom = static_cast<float>(size.height - 1);
  if (!(x >= 0 && y >= 0 && x <= right && y <= bottom)) return kUnknown;
  const int x0 = std::clamp(static_cast<int>(x), 0, std::max(size.width - 2, 0));
  const int y0 = std::clamp(static_cast<int>(y), 0, std::max(size.height - 2, 0));
  const float along_x = x - static_cast<float>(x0);
  const float along_y = y - static_cast<float>(y0);
  float sum = 0;
  for (const int dy : {0, 1}) {
    for (const int dx : {0, 1}) {
      const float weight = (dx == 0 ? 1 - along_x : along_x) * (dy == 0 ? 1 - along_y : along_y);
      // NaN times zero is NaN; and a picture of one row or column has no neighbour there.
      if (weight == 0) continue;
      sum +=
          weight * values[static_cast<std::size_t>(y0 + dy) * static_cast<std::size_t>(size.width) +
                          static_cast<std::size_t>(x0 + dx)];
    }
  }
  return sum;
}

/// Carries every pixel's displacement on by one frame interval.
void follow(FlowField& path, const FlowField& step) {
  for (int y = 0; y < path.size.height; ++y) {
    for (int x = 0; x < path.size.width; ++x) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(path.size.width) +
                      static_cast<std::size_t>(x);
      const float now_x = static_cast<float>(x) + path.x_px[at];
      const float now_y = static_cast<float>(y) + path.y_px[at];
      path.x_px[at] += value_at(step.x_px, step.size, now_x, now_y);
      path.y_px[at] += value_at(step.y_px, step.size, now_x, now_y);
    }
  }
}

}  // namespace

std::optional<FlowField> flow_path(const Recording& recording, const FrameInterval& interval) {
  std::optional<FlowField> path = recording.flow(interval.first);
  for (std::int64_t frame = interval.first + 1; path && frame < interval.last; ++frame) {
    const std::optional<FlowField> step = recording.flow(frame);
    if (!step) return std::nullopt;
    follow(*path, *step);
  }
  return path;
}

}  // namespace eventgan
