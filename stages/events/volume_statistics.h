#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "manifests/volume.h"

namespace eventgan {

/// η98 (DESIGN section 5): of the n non-zero values of the volume in ascending order the k-th,
/// k = max(int(0.98 n), 1); 0 if there is none. Throws std::invalid_argument for values that are
/// not finite or are below zero. Thread safe.
float eta98(std::span<const float> volume);

/// Statistics of a volume of shape `whole`, of which `content` [2 bins, h, w] are the values of a
/// part and all others zero. Nothing if a value is NaN, infinite or below zero: first_unsound_value
/// says which. One pass over the values, and a look at the largest of them for η98. For the order
/// of the sums see ValueScan. `flags` has kFlagEmpty or nothing. Thread safe.
std::optional<VolumeStatistics> volume_statistics(std::span<const float> content,
                                                  const VolumeShape& whole);

/// Index of the first value that is NaN, infinite or below zero; volume.size() if there is none.
std::size_t first_unsound_value(std::span<const float> volume);

}  // namespace eventgan
