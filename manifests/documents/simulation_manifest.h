#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "manifests/values/simulation.h"

namespace eventgan {

/// Throws UsageError listing every fault, InputError if the file cannot be read.
SimulationManifest read_simulation_manifest(const std::filesystem::path& file);

/// The same from text; `name` stands for the file in messages.
SimulationManifest parse_simulation_manifest(std::string_view text,
                                             const std::filesystem::path& directory,
                                             const std::string& name);

}  // namespace eventgan
