#pragma once

#include <filesystem>
#include <memory>

#include "manifests/job_manifest.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// open_frames_dataset for folders. Where pictures and folders lie side by side, the pictures count
/// and the folders are named in the notes. The label_key is the sidecar's path below ROOT; the
/// picture's if there is none.
std::unique_ptr<Dataset> open_pictures_dataset(const SourceSpec& spec,
                                               const std::filesystem::path& base);

}  // namespace eventgan
