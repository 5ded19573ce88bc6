#include "stages/events/event_places.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

namespace eventgan {
namespace {

/// The pixels whose centres lie in [first, last), of `count`.
std::pair<int, int> pixels_between(double first, double last, int count) {
  const auto pixel = [&](double edge) {
    return static_cast<int>(std::clamp(std::ceil(edge - 0.5), 0.0, static_cast<double>(count)));
  };
  return {pixel(first), pixel(last)};
}

}  // namespace

std::vector<double> channel_sums(std::span<const float> volume, const VolumeShape& shape) {
  const std::size_t plane = shape.size.pixel_count();
  std::vector<double> sums;
  for (int channel = 0; channel < shape.channels(); ++channel) {
    const auto values = volume.subspan(static_cast<std::size_t>(channel) * plane, plane);
    sums.push_back(std::accumulate(values.begin(), values.end(), 0.0));
  }
  return sums;
}

std::vector<std::uint8_t> event_mask(std::span<const float> volume, const VolumeShape& shape,
                                     double least) {
  const std::size_t plane = shape.size.pixel_count();
  std::vector<float> sums(plane, 0.0f);
  for (std::size_t i = 0; i < volume.size(); ++i) sums[i % plane] += volume[i];
  std::vector<std::uint8_t> mask(plane);
  std::ranges::transform(sums, mask.begin(), [&](float sum) { return sum >= least ? 1 : 0; });
  return mask;
}

std::optional<double> share_inside(std::span<const std::uint8_t> mask, ImageSize size,
                                   const Rectangle& box) {
  const auto [left, right] = pixels_between(box.left, box.right, size.width);
  const auto [top, bottom] = pixels_between(box.top, box.bottom, size.height);
  if (left >= right || top >= bottom) return std::nullopt;
  std::int64_t set = 0;
  for (int y = top; y < bottom; ++y) {
    const auto row = mask.begin() + static_cast<std::ptrdiff_t>(y) * size.width;
    set += std::accumulate(row + left, row + right, std::int64_t{0});
  }
  return static_cast<double>(set) / (static_cast<double>(right - left) * (bottom - top));
}

std::optional<bool> is_set_near(std::span<const std::uint8_t> mask, ImageSize size, Point point,
                                int radius) {
  const double x = std::round(point.x), y = std::round(point.y);
  if (!(x >= 0 && x < size.width && y >= 0 && y < size.height)) return std::nullopt;
  const Rectangle square{x - radius, y - radius, x + radius + 1, y + radius + 1};
  return share_inside(mask, size, square).value_or(0) > 0;
}

}  // namespace eventgan
