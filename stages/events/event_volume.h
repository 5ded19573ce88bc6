#pragma once

#include <span>
#include <vector>

#include "manifests/event.h"
#include "manifests/volume.h"

namespace eventgan {

/// V(x,y,b) = Σ_i max(0, 1 - |b - t*_i|), t*_i = (B-1)(t_i - t_1)/(t_N - t_1), per polarity (DESIGN
/// section 5); [2 bins, H, W] float32, C order. Events in time order. No events → zeros; t_N = t_1
/// → t* = 0. Throws std::invalid_argument for an event outside the picture or a time that is not
/// finite. Thread safe.
std::vector<float> event_volume(std::span<const Event> events, const VolumeShape& shape);

}  // namespace eventgan
