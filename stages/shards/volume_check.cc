#include "stages/shards/volume_check.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "stages/shards/codec/half_float.h"

namespace eventgan {
namespace {

struct Found {
  bool sound = true;
  double max = 0;
  double sum_positive = 0;
  double sum_negative = 0;
  std::size_t nonzero = 0;
};

Found look_at(std::span<const float> volume) {
  Found found;
  for (std::size_t i = 0; i < volume.size(); ++i) {
    const float value = volume[i];
    if (!std::isfinite(value) || value < 0) found.sound = false;
    found.max = std::max(found.max, static_cast<double>(value));
    (2 * i < volume.size() ? found.sum_positive : found.sum_negative) += value;
    found.nonzero += value != 0;
  }
  return found;
}

/// How far a stored value can lie from the generated one: relative (and as much again for the
/// statistics' own rounding) and absolute.
struct Error {
  double relative;
  double absolute;
};

Error storage_error(StoredType type, float scale) {
  constexpr double kFloatStatistics = 1e-6;
  switch (type) {
    case StoredType::kFloat32:
      return {kFloatStatistics, 0};
    case StoredType::kFloat16:  // 11 bits of mantissa; below 2^-14 steps of 2^-24
      return {0x1p-11 + kFloatStatistics, 0x1p-25};
    case StoredType::kUint8:
      return {kFloatStatistics, 0.5 * scale};
  }
  return {0, 0};
}

std::string text(const char* name, double recorded, double stored) {
  return fmt::format("expected {} {:g} as recorded, got {:g}", name, recorded, stored);
}

}  // namespace

std::optional<std::string> volume_fault(const ShardHeader& header, const ShardSample& sample,
                                        std::span<const float> volume) {
  const Found found = look_at(volume);
  if (!found.sound) return "expected finite values >= 0 in the volume, got others";
  if (!sample.valid) {
    if (found.nonzero == 0) return std::nullopt;
    return "expected zeros for a quarantined sample, got other values";
  }

  const VolumeStatistics& recorded = sample.statistics;
  const Error error = storage_error(header.dtype, sample.scale);
  const auto near = [&](double expected, double got, double values) {
    return std::abs(expected - got) <=
           error.relative * std::abs(expected) + error.absolute * values;
  };

  // The statistics are of the volume as generated; normalised by eta98 and clipped, its largest
  // value is 1.
  const bool as_generated = header.normalization == Normalization::kNone;
  const bool saturated = (recorded.flags & kFlagSaturated) != 0;
  double max = recorded.max;
  if (!as_generated) max = recorded.max > 0 ? 1 : 0;
  if (saturated) max = std::min<double>(max, kLargestHalf);
  if (!near(max, found.max, 1)) return text("largest value", max, found.max);

  const bool vanished = found.nonzero == 0 && recorded.max > 0;
  if (((recorded.flags & kFlagVanished) != 0) != vanished) {
    return std::string(
               "expected the flag \"vanished\" of a volume of zeros alone that was not "
               "generated so, and of no other, got it ") +
           (vanished ? "not set" : "set");
  }

  const auto size = static_cast<double>(volume.size());
  const double nonzero_fraction = static_cast<double>(found.nonzero) / size;
  const double recorded_fraction = recorded.nonzero_fraction;
  // Rounding to coarser numbers can make values zero, never the other way round.
  const bool exact = header.dtype == StoredType::kFloat32 && as_generated;
  if (nonzero_fraction > recorded_fraction + 1e-6 ||
      (exact && nonzero_fraction < recorded_fraction - 1e-6)) {
    return text("non-zero fraction", recorded_fraction, nonzero_fraction);
  }
  if (!as_generated || saturated) return std::nullopt;
  if (!near(recorded.sum_positive, found.sum_positive, size / 2)) {
    return text("sum of positive polarity", recorded.sum_positive, found.sum_positive);
  }
  if (!near(recorded.sum_negative, found.sum_negative, size / 2)) {
    return text("sum of negative polarity", recorded.sum_negative, found.sum_negative);
  }
  return std::nullopt;
}

}  // namespace eventgan
