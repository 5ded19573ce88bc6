#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "manifests/values/training.h"

namespace eventgan {

/// Throws UsageError listing every fault, InputError if the file cannot be read.
TrainingManifest read_training_manifest(const std::filesystem::path& file);

/// The same from text; `name` stands for the file in messages.
TrainingManifest parse_training_manifest(std::string_view text,
                                         const std::filesystem::path& directory,
                                         const std::string& name);

}  // namespace eventgan
