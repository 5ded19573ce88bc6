#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/events.h"

namespace eventgan {

/// What one pass over some values finds.
struct ValueScan {
  std::span<const float> values;
  bool sound = true;        ///< all are finite and >= 0 (-0 is); if not, the rest means nothing
  std::size_t nonzero = 0;  ///< how many are not zero
  /// In double precision and always in one order: value i adds to partial sum i % 16, then these
  /// add up in ascending order.
  double sum = 0;
  float max = 0;                    ///< largest value
  std::vector<float> group_maxima;  ///< the largest of every 16 values or fewer: see kth_largest
};

/// Scans the values, which must outlive the scan. Thread safe.
ValueScan scan_values(std::span<const float> values);

/// The k-th largest of all values of the scans together that are not zero, 1 <= k <= their number.
/// The scans must be sound.
///
/// Values below some bound need not be looked at one by one: at least k groups reach the k-th
/// largest of the groups' maxima, so at least k values do, and the k-th largest value is no
/// smaller. Only groups that reach that bound are read again, and the values that do are copied:
/// few where k is a small part of the values, but all of those that are nearly equal to the k-th
/// largest. Thread safe.
float kth_largest(std::span<const ValueScan> scans, std::size_t k);

/// η98, as the published code takes it: of the n non-zero values of the volume in ascending order
/// the k-th, k = max(int(0.98 n), 1); 0 if there is none. Throws std::invalid_argument for values
/// that are not finite or are below zero. Thread safe.
float eta98(std::span<const float> volume);

/// Statistics of a volume of shape `whole`, of which `content` [2 bins, h, w] are the values of a
/// part and all others zero. Nothing if a value is NaN, infinite or below zero: first_unsound_value
/// says which. One pass over the values, and a look at the largest of them for η98. For the order
/// of the sums see ValueScan. `flags` has kFlagEmpty or nothing. Thread safe.
std::optional<VolumeStatistics> volume_statistics(std::span<const float> content,
                                                  const VolumeShape& whole);

/// Index of the first value that is NaN, infinite or below zero; volume.size() if there is none.
std::size_t first_unsound_value(std::span<const float> volume);

/// V̂ = min(V, η98)/η98 in place, in [0, 1]; values that reach η98 become 1 exactly. For η98 = 0,
/// that of an empty volume, nothing changes. As the published code, for volumes ≥ 0, where its
/// max(|2nd percentile|, 98th) is the 98th. Thread safe.
void normalize(std::span<float> volume, float eta98);

/// The volume of counts divided by its own η98 and clipped: V̂. Throws std::invalid_argument for
/// values that are not finite or are below zero. Thread safe.
std::vector<float> normalized(std::vector<float> volume);

}  // namespace eventgan
