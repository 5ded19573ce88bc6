#pragma once

#include <filesystem>
#include <memory>

#include "stages/generator/checkpoints/checkpoint_archive.h"

namespace eventgan {

/// Opens a checkpoint of PyTorch 0.1.10 to 1.5 (later ones write it on request). One after another
/// stand five pickles: the magic number; the protocol version 1001; facts about the machine that
/// wrote it, which must have been little endian; the data, whose tensors name storages by key; the
/// list of these keys. Then for each key in that order the number of values (int64) and the values,
/// little endian.
///
/// Every number of values is checked against the file and against what the data says of the
/// storage. Memory as checkpoint_limits.h. Throws std::runtime_error naming the file.
std::unique_ptr<CheckpointArchive> open_legacy_checkpoint(const std::filesystem::path& file);

}  // namespace eventgan
