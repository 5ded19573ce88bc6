#pragma once

#include <string>

#include "manifests/shard.h"

namespace eventgan {

// What the attributes of /events/volume say in words.

/// One text for each unit and normalisation, so that it can be read back.
std::string unit_text(VolumeUnit unit, Normalization normalization);

std::string time_axis_text(VolumeUnit unit);

}  // namespace eventgan
