#pragma once

#include <cstddef>
#include <span>
#include <vector>

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

}  // namespace eventgan
