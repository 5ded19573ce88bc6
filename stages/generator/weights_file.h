#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "stages/generator/weights.h"

namespace eventgan {

/// The weights as a safetensors file: tensors NAME.weight and NAME.bias for each convolution;
/// metadata `format` ("eventgan-generator"), `format_version`, `base_channels`, `bins`,
/// `training_gaps` ("1-5"; absent if not known) and Weights::metadata; the calibration, if there is
/// one, as weights_file.cc says. Deterministic.
std::string serialize_weights(const Weights& weights);

/// Reads and checks such a file. Throws InputError (with the cause nested) if it is absent,
/// malformed, not a generator, has half a calibration, or numbers that are not finite.
Weights read_weights(const std::filesystem::path& file);

/// The same from bytes; `name` stands for the file in messages.
Weights parse_weights(std::string_view bytes, const std::string& name);

}  // namespace eventgan
