#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/simulation_manifest.h"
#include "pipeline/simulation/clip_frames.h"

namespace eventgan {

/// A recording that a source gives.
struct PlannedRecording {
  std::string name;  ///< and random key; the file is NAME.hdf5
  std::filesystem::path file;
  std::string settings;  ///< recording_settings()
  std::optional<std::int64_t>
      picture;  ///< kAffine: position of its picture among the clip's frames
  std::int64_t frame_count = 0;
};

/// One for a clip, NAME; with kAffine one for each picture, NAME-000, NAME-001 and so on: nothing
/// moves from one picture to another, so no pair of frames may reach across.
std::vector<PlannedRecording> plan_recordings(const SimulationManifest& manifest,
                                              const SimulationSource& source,
                                              const ClipFrames& clip,
                                              const std::filesystem::path& folder);

}  // namespace eventgan
