#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "stages/events/realism/agreement_internal.h"

namespace eventgan {
namespace {

double mean(std::span<const double> values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

bool constant(std::span<const double> values) {
  return std::ranges::all_of(values, [&](double value) { return value == values.front(); });
}

/// Mean difference of one block of one plane: pooling is linear, so the difference of the means.
double block_difference(const float* values, const float* real, ImageSize size, int top, int left,
                        int side) {
  const int bottom = std::min(top + side, size.height);
  const int right = std::min(left + side, size.width);
  double sum = 0;
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(y) * size.width + x;
      sum += static_cast<double>(values[at]) - static_cast<double>(real[at]);
    }
  }
  return sum / ((bottom - top) * (right - left));
}

}  // namespace

double binary_match_f1(std::span<const float> values, std::span<const float> real) {
  std::size_t both = 0;
  std::size_t events = 0;  // 2 TP + FP + FN: the events of one plus those of the other
  for (std::size_t i = 0; i < values.size(); ++i) {
    const bool here = values[i] > kEventThreshold;
    const bool there = real[i] > kEventThreshold;
    both += here && there;
    events += static_cast<std::size_t>(here) + static_cast<std::size_t>(there);
  }
  return events == 0 ? 1.0 : 2.0 * static_cast<double>(both) / static_cast<double>(events);
}

double pool_mse(std::span<const float> values, std::span<const float> real, ImageSize size,
                int side) {
  const std::size_t plane = size.pixel_count();
  double sum = 0;
  std::size_t blocks = 0;
  for (std::size_t start = 0; start < values.size(); start += plane) {
    for (int top = 0; top < size.height; top += side) {
      for (int left = 0; left < size.width; left += side) {
        const double difference =
            block_difference(values.data() + start, real.data() + start, size, top, left, side);
        sum += difference * difference;
        ++blocks;
      }
    }
  }
  return sum / static_cast<double>(blocks);
}

double pearson(std::span<const double> a, std::span<const double> b) {
  // Exactly: a sum of squares about the mean is seldom exactly zero for a constant.
  if (a.empty() || constant(a) || constant(b)) return std::numeric_limits<double>::quiet_NaN();
  const double mean_a = mean(a);
  const double mean_b = mean(b);
  double covariance = 0;
  double variance_a = 0;
  double variance_b = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double from_a = a[i] - mean_a;
    const double from_b = b[i] - mean_b;
    covariance += from_a * from_b;
    variance_a += from_a * from_a;
    variance_b += from_b * from_b;
  }
  return covariance / std::sqrt(variance_a * variance_b);
}

}  // namespace eventgan
