#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/simulation.h"
#include "pipeline/simulation/clip_frames.h"
#include "pipeline/simulation/still_scenes.h"

namespace eventgan {

/// Everything that decides a recording's bytes, as JSON: program, seed, name, source, the clip's
/// files, sensor. It is in the recording as `simulation`, says where a recording
/// came from, and tells whether an existing one is what a job would make. What the manifest says of
/// other recordings is left out, so that they may change.
///
/// `image`: if the method moves_one_frame, the frame's number within its clip; else none. `still`:
/// kStills, its name; else empty.
std::string recording_settings(const SimulationManifest& manifest, const SimulationSource& source,
                               const std::string& recording, const std::string& files_hash,
                               std::optional<std::int64_t> image, const std::string& still = "");

/// Throws UsageError if the recording with the settings `found` was made of another clip than one
/// with `expected` would be: it is somebody else's.
void check_same_clip(const std::filesystem::path& file, const std::string& found,
                     const std::string& expected);

/// Throws UsageError telling field by field how `found` differs from `expected`, if it does.
void check_same_settings(const std::filesystem::path& file, const std::string& found,
                         const std::string& expected);

/// A recording that a source gives.
struct PlannedRecording {
  std::string name;  ///< and random key; the file is NAME with the ending of its format
  std::filesystem::path file;
  std::string settings;  ///< recording_settings()
  /// If the method moves_one_frame: position of the frame among the clip's; kStills: of its clip.
  std::optional<std::int64_t> image;
  std::int64_t frame_count = 0;
};

/// One for a clip, NAME; if the method moves_one_frame, one for each image, NAME-000 and so on:
/// nothing moves from one image to another, so no pair of frames may reach across.
std::vector<PlannedRecording> plan_recordings(const SimulationManifest& manifest,
                                              const SimulationSource& source,
                                              const ClipFrames& clip,
                                              const std::filesystem::path& folder);

/// One for each clip, NAME-000 and so on; of a still with a fault there is none, and what
/// StillScenes::hash says of it is added to `faults`.
std::vector<PlannedRecording> plan_recordings(const SimulationManifest& manifest,
                                              const SimulationSource& source,
                                              const StillScenes& scenes,
                                              const std::filesystem::path& folder,
                                              std::vector<std::string>& faults);

}  // namespace eventgan
