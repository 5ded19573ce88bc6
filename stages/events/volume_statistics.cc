#include "stages/events/volume_statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "stages/events/value_scan.h"

namespace eventgan {
namespace {

float eta98(std::span<const ValueScan> scans, std::size_t nonzero) {
  if (nonzero == 0) return 0.0f;
  // int(0.98 n) in double precision, as Python computes it.
  const auto k = std::max<std::size_t>(static_cast<std::size_t>(0.98 * double(nonzero)), 1);
  return kth_largest(scans, nonzero - k + 1);
}

}  // namespace

float eta98(std::span<const float> volume) {
  const ValueScan scan = scan_values(volume);
  if (!scan.sound) throw std::invalid_argument("expected finite values >= 0, got others");
  return eta98({&scan, 1}, scan.nonzero);
}

std::optional<VolumeStatistics> volume_statistics(std::span<const float> content,
                                                  const VolumeShape& whole) {
  const std::size_t half = content.size() / 2;
  const std::array scans{scan_values(content.first(half)), scan_values(content.subspan(half))};
  const auto& [positive, negative] = scans;
  if (!positive.sound || !negative.sound) return std::nullopt;
  const std::size_t nonzero = positive.nonzero + negative.nonzero;
  const std::size_t count = whole.value_count();
  VolumeStatistics statistics;
  statistics.eta98 = eta98(scans, nonzero);
  statistics.max = std::max(positive.max, negative.max);
  statistics.nonzero_fraction =
      count == 0 ? 0.0f : static_cast<float>(double(nonzero) / double(count));
  statistics.sum_positive = positive.sum;
  statistics.sum_negative = negative.sum;
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
