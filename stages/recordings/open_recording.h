#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "manifests/training_manifest.h"
#include "stages/recordings/recording.h"

namespace eventgan {

/// Opens a recording: reads the frames' times and checks that everything is there and fits
/// together; where a frame's events end is looked up when first asked for. Throws InputError
/// "expected X, got Y, in PATH" if it is absent or not of this format. `camera` is for kMvsec.
std::unique_ptr<Recording> open_recording(const std::filesystem::path& path, RecordingFormat format,
                                          const std::string& camera = "left");

}  // namespace eventgan
