#pragma once

#include <filesystem>
#include <memory>

#include "stages/generator/checkpoints/checkpoint_archive.h"

namespace eventgan {

/// Opens a checkpoint of PyTorch 1.6 or later: a zip file with NAME/data.pkl and the storages
/// NAME/data/KEY. Memory as checkpoint_limits.h. Throws std::runtime_error naming the file.
std::unique_ptr<CheckpointArchive> open_zip_checkpoint(const std::filesystem::path& file);

}  // namespace eventgan
