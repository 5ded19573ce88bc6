#pragma once

#include <string>
#include <vector>

#include "stages/generator/weights_files/safetensors.h"

namespace eventgan {

// What a reader takes out of a file's content, so that what is left over is known. Both throw
// std::runtime_error "expected X, got Y".

/// A whole number in 1..largest from the metadata.
int take_number(SafetensorsFile& content, const std::string& key, int largest);

/// A tensor of exactly this shape.
std::vector<float> take_tensor(SafetensorsFile& content, const std::string& name,
                               const std::vector<std::int64_t>& shape);

}  // namespace eventgan
