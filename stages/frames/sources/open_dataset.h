#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// What the name of a sequence of a dataset tells: Human3.6M's "S1/Directions-1/54138969" or
/// "S1_Directions_1.54138969", KITTI's drive. A function of its arguments alone.
FrameOrigin frame_origin(DatasetKind dataset, const std::string& sequence);

/// Opens the source described by `spec`; relative paths start at `base`, the manifest's folder.
/// Throws InputError if the source's root or an annotation file is missing or unreadable, or a
/// frame's name has a NUL, at which a shard's and a file system's names end;
/// UsageError if the manifest's keys do not fit what is there.
std::unique_ptr<Dataset> open_dataset(const SourceSpec& spec, const std::filesystem::path& base);

}  // namespace eventgan
