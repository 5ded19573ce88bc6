#pragma once

#include <filesystem>
#include <string>

#include "manifests/values/training.h"

namespace eventgan::testing {

/// The text of a manifest of a tiny training on `bar.hdf5`: networks of base width 2, crop 48x48,
/// batches of 2; 2 steps of flow, 2 of reconstruction, 4 of the generator; checkpoints and images
/// never but where a phase or a run ends.
std::string small_training_text();

/// Writes FOLDER/bar.hdf5, a moving bar in MVSEC's layout: 56x64, 9 frames.
void write_bar_recording(const std::filesystem::path& folder);

/// Both: the recording is written, the manifest writes to FOLDER/out. `replace` is changed into
/// `with` in the manifest's text first; throws if it is not there.
TrainingManifest small_training(const std::filesystem::path& folder,
                                const std::string& replace = "", const std::string& with = "");

}  // namespace eventgan::testing
