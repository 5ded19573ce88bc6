#pragma once

#include <filesystem>
#include <memory>

#include "manifests/job_manifest.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// True for mp4, avi, mov and mkv, in small or capital letters.
bool is_video_name(const std::filesystem::path& file);

/// open_frames_dataset for a video. The label_key is the frame's number; empty if it has no label.
std::unique_ptr<Dataset> open_video_dataset(const SourceSpec& spec,
                                            const std::filesystem::path& base);

}  // namespace eventgan
