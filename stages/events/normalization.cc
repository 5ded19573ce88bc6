#include "stages/events/normalization.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

namespace eventgan {

float eta98(std::span<const float> volume) {
  std::vector<float> nonzero;
  std::copy_if(volume.begin(), volume.end(), std::back_inserter(nonzero),
               [](float value) { return value != 0.0f; });
  if (nonzero.empty()) return 0.0f;
  // int(0.98 n) in double precision, as Python computes it.
  const auto k = std::max<std::size_t>(static_cast<std::size_t>(0.98 * double(nonzero.size())), 1);
  const auto kth = nonzero.begin() + static_cast<std::ptrdiff_t>(k - 1);
  std::nth_element(nonzero.begin(), kth, nonzero.end());
  return *kth;
}

void normalize(std::span<float> volume, float eta98) {
  if (eta98 <= 0.0f) return;
  for (float& value : volume) value = std::min(value, eta98) / eta98;
}

std::vector<float> normalized(std::vector<float> volume) {
  normalize(volume, eta98(volume));
  return volume;
}

VolumeStatistics volume_statistics(std::span<const float> volume, const VolumeShape& shape) {
  VolumeStatistics statistics;
  std::size_t nonzero = 0;
  const std::size_t positive_count = shape.bins * shape.size.pixel_count();
  for (std::size_t i = 0; i < volume.size(); ++i) {
    const float value = volume[i];
    nonzero += value != 0.0f;
    statistics.max = std::max(statistics.max, value);
    (i < positive_count ? statistics.sum_positive : statistics.sum_negative) += value;
  }
  statistics.eta98 = eta98(volume);
  statistics.nonzero_fraction =
      volume.empty() ? 0.0f : static_cast<float>(double(nonzero) / double(volume.size()));
  if (nonzero == 0) statistics.flags |= kFlagEmpty;
  return statistics;
}

std::size_t first_unsound_value(std::span<const float> volume) {
  const auto bad = std::find_if(volume.begin(), volume.end(), [](float value) {
    return !(value >= 0.0f) || std::isinf(value);  // the negation catches NaN
  });
  return static_cast<std::size_t>(bad - volume.begin());
}

}  // namespace eventgan
