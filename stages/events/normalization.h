#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "manifests/volume.h"

namespace eventgan {

/// η98 (DESIGN section 5): of the n non-zero values of the volume in ascending order the k-th,
/// k = max(int(0.98 n), 1); 0 if there is none. Values must be ≥ 0 and finite. Thread safe.
float eta98(std::span<const float> volume);

/// V̂ = min(V, η98)/η98 in place, in [0, 1]; an empty volume stays zero. As the published code, for
/// volumes ≥ 0, where its max(|2nd percentile|, 98th) is the 98th. Thread safe.
void normalize(std::span<float> volume, float eta98);

/// The volume of counts divided by its own η98 and clipped: V̂.
std::vector<float> normalized(std::vector<float> volume);

/// One pass over the volume [2 bins, H, W], plus η98. `flags` has kFlagEmpty or nothing.
VolumeStatistics volume_statistics(std::span<const float> volume, const VolumeShape& shape);

/// Index of the first value that is NaN, infinite or below zero; volume.size() if there is none.
std::size_t first_unsound_value(std::span<const float> volume);

}  // namespace eventgan
