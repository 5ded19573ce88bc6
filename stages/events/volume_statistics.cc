#include "stages/events/volume_statistics.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <limits>
#include <stdexcept>

#include "stages/base/processor_clones.h"

namespace eventgan {
namespace {

// A block of values is read from memory once and then stays in the first-level cache. Its rows are
// as wide as loops need to become vector instructions; a group is a lane through its rows.
constexpr std::size_t kLanes = 16;
constexpr std::size_t kRows = 16;
constexpr std::size_t kBlock = kLanes * kRows;

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

namespace {

/// Parts of a block's row, no wider than AVX2's registers, since GCC takes wider ones apart value
/// by value; GCC's and Clang's vectors, since loops over lanes that keep maximum and minimum do not
/// become vector instructions by themselves.
constexpr std::size_t kWide = 8, kNarrow = 4;
typedef float Wide __attribute__((vector_size(kWide * sizeof(float))));
typedef float Narrow __attribute__((vector_size(kNarrow * sizeof(float))));
typedef double Sums __attribute__((vector_size(kNarrow * sizeof(double))));
typedef std::int32_t Counts __attribute__((vector_size(kWide * sizeof(std::int32_t))));

struct LaneScan {
  Wide max[kLanes / kWide]{}, min[kLanes / kWide]{};
  Sums sum[kLanes / kNarrow]{};
  Counts nonzero[kLanes / kWide]{};
};

template <class Part>
inline Part part_at(const float* values) {
  Part part;
  std::memcpy(&part, values, sizeof part);
  return part;
}

EVENTGAN_CLONES void scan_lanes(std::span<const float> values, LaneScan& lanes,
                                float* group_maxima) {
  LaneScan found;
  for_each_block(values, [&](std::size_t block, const float* numbers) {
    Wide maxima[kLanes / kWide]{};
    for (std::size_t row = 0; row < kRows; ++row, numbers += kLanes) {
      for (std::size_t i = 0; i < kLanes / kWide; ++i) {
        const auto value = part_at<Wide>(numbers + i * kWide);
        maxima[i] = value > maxima[i] ? value : maxima[i];
        found.min[i] = value < found.min[i] ? value : found.min[i];
        found.nonzero[i] -= value != 0;  // true is -1
      }
      for (std::size_t i = 0; i < kLanes / kNarrow; ++i) {
        found.sum[i] += __builtin_convertvector(part_at<Narrow>(numbers + i * kNarrow), Sums);
      }
    }
    for (std::size_t i = 0; i < kLanes / kWide; ++i) {
      found.max[i] = maxima[i] > found.max[i] ? maxima[i] : found.max[i];
    }
    std::memcpy(group_maxima + block * kLanes, &maxima, sizeof maxima);
  });
  lanes = found;
}

}  // namespace

ValueScan scan_values(std::span<const float> values) {
  ValueScan scan;
  scan.values = values;
  scan.group_maxima.resize((values.size() + kBlock - 1) / kBlock * kLanes);
  LaneScan lanes;
  scan_lanes(values, lanes, scan.group_maxima.data());
  float min = 0;
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    const std::size_t wide = lane / kWide, place = lane % kWide;
    scan.sum += lanes.sum[lane / kNarrow][lane % kNarrow];
    scan.nonzero += static_cast<std::uint32_t>(lanes.nonzero[wide][place]);
    scan.max = std::max(scan.max, lanes.max[wide][place]);
    min = std::min(min, lanes.min[wide][place]);
  }
  // NaN and infinity stay in a sum; floats that are finite cannot overflow one in double precision.
  scan.sound = std::isfinite(scan.sum) && min >= 0;
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
