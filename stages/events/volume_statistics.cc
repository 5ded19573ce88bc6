#include "stages/events/volume_statistics.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>

namespace eventgan {
namespace {

// A block of values is read from memory once and then stays in the first-level cache. Its rows are
// as wide as loops need to become vector instructions; a group is a lane through its rows.
constexpr std::size_t kLanes = 16;
constexpr std::size_t kRows = 16;
constexpr std::size_t kBlock = kLanes * kRows;

template <class T>
using Lanes = std::array<T, kLanes>;

/// Calls work(number of the block, its values); the last block is filled up with zeros.
template <class Work>
void for_each_block(std::span<const float> values, Work work) {
  const std::size_t whole = values.size() / kBlock;
  for (std::size_t block = 0; block < whole; ++block) work(block, values.data() + block * kBlock);
  const std::span<const float> rest = values.subspan(whole * kBlock);
  if (rest.empty()) return;
  std::array<float, kBlock> last{};
  std::copy(rest.begin(), rest.end(), last.begin());
  work(whole, last.data());
}

/// Calls step(value, lane) row by row.
template <class Step>
void for_each_value(const float* block, Step step) {
  for (std::size_t row = 0; row < kRows; ++row) {
    for (std::size_t lane = 0; lane < kLanes; ++lane) step(block[row * kLanes + lane], lane);
  }
}

/// A bound that at least `k` of the maxima reach, if so many are not zero; else 0. All that is
/// looked at is the upper half of a number's bits, which for numbers >= 0 are in the numbers'
/// order.
float bound_reached_by(std::span<const ValueScan> scans, std::size_t k) {
  std::vector<std::uint32_t> table(std::size_t{1} << 15);
  for (const ValueScan& scan : scans) {
    for (const float maximum : scan.group_maxima) {
      ++table[std::bit_cast<std::uint32_t>(maximum) >> 16];
    }
  }
  std::uint32_t upper = static_cast<std::uint32_t>(table.size());
  for (std::size_t reached = 0; reached < k && upper > 0;) reached += table[--upper];
  return std::bit_cast<float>(upper << 16);
}

/// All values that reach the bound, which is above zero.
std::vector<float> values_from(std::span<const ValueScan> scans, float bound) {
  std::vector<float> found;
  for (const ValueScan& scan : scans) {
    for_each_block(scan.values, [&](std::size_t block, const float* values) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        if (scan.group_maxima[block * kLanes + lane] < bound) continue;
        std::size_t size = found.size();
        found.resize(size + kRows);
        for (std::size_t row = 0; row < kRows; ++row) {  // without a branch hard to foresee
          found[size] = values[row * kLanes + lane];
          size += found[size] >= bound;
        }
        found.resize(size);
      }
    });
  }
  return found;
}

}  // namespace

ValueScan scan_values(std::span<const float> values) {
  ValueScan scan;
  scan.values = values;
  scan.group_maxima.resize((values.size() + kBlock - 1) / kBlock * kLanes);
  Lanes<double> sums{};
  Lanes<float> minima{};
  Lanes<std::uint32_t> nonzero{};
  for_each_block(values, [&](std::size_t block, const float* numbers) {
    Lanes<float> maxima{};
    for_each_value(numbers, [&](float value, std::size_t lane) {
      maxima[lane] = value > maxima[lane] ? value : maxima[lane];
      minima[lane] = value < minima[lane] ? value : minima[lane];
    });
    std::copy(maxima.begin(), maxima.end(), scan.group_maxima.begin() + block * kLanes);
    for_each_value(numbers, [&](float value, std::size_t lane) { sums[lane] += value; });
    for_each_value(numbers, [&](float value, std::size_t lane) { nonzero[lane] += value != 0.0f; });
  });
  for (const double sum : sums) scan.sum += sum;
  for (const std::uint32_t count : nonzero) scan.nonzero += count;
  for (const float maximum : scan.group_maxima) scan.max = std::max(scan.max, maximum);
  // NaN and infinity stay in a sum; floats that are finite cannot overflow one in double precision.
  scan.sound = std::isfinite(scan.sum) && *std::min_element(minima.begin(), minima.end()) >= 0;
  return scan;
}

float kth_largest(std::span<const ValueScan> scans, std::size_t k) {
  const float bound =
      std::max(bound_reached_by(scans, k), std::numeric_limits<float>::denorm_min());
  std::vector<float> found = values_from(scans, bound);
  const auto kth = found.begin() + static_cast<std::ptrdiff_t>(k - 1);
  std::nth_element(found.begin(), kth, found.end(), std::greater<>());
  return *kth;
}

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

void normalize(std::span<float> volume, float eta98) {
  if (eta98 <= 0.0f) return;
  for (float& value : volume) value = std::min(value, eta98) / eta98;
}

std::vector<float> normalized(std::vector<float> volume) {
  normalize(volume, eta98(volume));
  return volume;
}

}  // namespace eventgan
