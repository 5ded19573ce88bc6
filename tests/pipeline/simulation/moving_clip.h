#pragma once

#include <filesystem>
#include <string>

#include "manifests/values/frames.h"
#include "manifests/values/simulation.h"

namespace eventgan::testing {

/// Writes the images 000.png, 001.png ... of a textured square that moves 2 pixels to the right
/// from each to the next, over a darker texture that stands still.
void write_moving_clip(const std::filesystem::path& folder, ImageSize size, int frames);

/// A simulation manifest with these sources (JSON objects) and output "out".
SimulationManifest moving_clip_manifest(const std::filesystem::path& folder,
                                        const std::string& sources, const std::string& more = "");

}  // namespace eventgan::testing
