#pragma once

#include <span>
#include <vector>

namespace eventgan {

/// V̂ = min(V, η98)/η98 in place, in [0, 1]; values that reach η98 become 1 exactly. For η98 = 0,
/// that of an empty volume, nothing changes. As the published code, for volumes ≥ 0, where its
/// max(|2nd percentile|, 98th) is the 98th. Thread safe.
void normalize(std::span<float> volume, float eta98);

/// The volume of counts divided by its own η98 and clipped: V̂. Throws std::invalid_argument for
/// values that are not finite or are below zero. Thread safe.
std::vector<float> normalized(std::vector<float> volume);

}  // namespace eventgan
