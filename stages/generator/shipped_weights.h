#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "stages/generator/weights.h"

namespace eventgan {

// The weights that are part of the program: the repository's files
// manifests/weights/eventgan-WIDTH.safetensors and eventgan-sensor.safetensors, embedded when the
// program is built. All functions are thread safe. A width may be kSensorWeights where it is given.

/// Base widths of the shipped weights, ascending; empty if the program was built without any.
std::vector<int> shipped_widths();

/// The width that the name "shipped" stands for: the largest one that is at most 16 (beyond it a
/// processor takes seconds for a pair). Throws InputError if there is none.
int default_shipped_width();

/// "shipped" with its width, "shipped:8"; any other name as it is.
std::string shipped_weights_name(const std::string& name);

/// The file's bytes as they are in the repository; they live as long as the program. Throws
/// InputError, listing the widths there are, if that width is not shipped.
std::span<const std::byte> shipped_weights_bytes(int width);

/// The weights of that width, read and checked as read_weights reads a file; throws as it does.
Weights read_shipped_weights(int width);

}  // namespace eventgan
