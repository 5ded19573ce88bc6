#pragma once

#include <cstdint>

#include "stages/generator/weights.h"

namespace eventgan {

/// A network of random numbers, for trying the program before weights exist: its volumes mean
/// nothing as events. He initialisation (normal, σ² = 2/fan-in), biases zero; the same seed gives
/// the same numbers everywhere.
Weights untrained_weights(int base_channels, int bins, std::uint64_t seed);

}  // namespace eventgan
