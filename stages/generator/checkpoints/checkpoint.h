#pragma once

#include <filesystem>
#include <string>

#include "manifests/values/weights.h"

namespace eventgan {

/// Reads one state dict out of a PyTorch checkpoint without executing anything from it: the zip
/// format (PyTorch 1.6 and later) or the older one, whichever the file's first bytes tell. The
/// checkpoint is a dict of state dicts and whatever else (then `network` says which, "gen" for the
/// published generator), or a generator's state dict itself. Tensors of float32, float64, float16,
/// bfloat16 and integers become float32; num_batches_tracked is left out, tensors of other networks
/// are not read: beside `network` there may be the published code's others (gen, dis, flow,
/// recons), optimisers (optimizer...) and whatever is no dict; any other dict is refused by name.
///
/// Lengths, strides and offsets are checked against the file before use; the memory taken is at
/// most twice the file's size and 64 MiB. Throws InputError (cause nested); where `network` is
/// absent the message lists the keys that are there.
StateDict read_checkpoint(const std::filesystem::path& file, const std::string& network);

}  // namespace eventgan
