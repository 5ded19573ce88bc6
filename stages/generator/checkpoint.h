#pragma once

#include <filesystem>
#include <string>

#include "stages/generator/state_dict.h"

namespace eventgan {

/// Reads one state dict out of a PyTorch checkpoint in the zip format (PyTorch ≥ 1.6) without
/// executing anything from it. The checkpoint is a dict of state dicts (then `network` says which,
/// "gen" for the published generator), or a state dict itself. Tensors of float32, float64, float16
/// and integers become float32; lengths, strides and offsets are checked against the archive before
/// use. Throws InputError (cause nested); where `network` is absent the message lists the keys that
/// are there.
StateDict read_checkpoint(const std::filesystem::path& file, const std::string& network);

}  // namespace eventgan
