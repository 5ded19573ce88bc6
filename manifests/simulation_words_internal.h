#pragma once

#include <array>

#include "manifests/simulation_manifest.h"
#include "manifests/strict_json/word_internal.h"

namespace eventgan {

inline constexpr std::array kSimulationMethodWords{
    Word<SimulationMethod>{"affine", SimulationMethod::kAffine},
    Word<SimulationMethod>{"clip", SimulationMethod::kClip},
    Word<SimulationMethod>{"difference", SimulationMethod::kDifference}};

}  // namespace eventgan
