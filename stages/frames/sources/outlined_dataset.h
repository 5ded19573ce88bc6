#pragma once

#include <filesystem>
#include <memory>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"

namespace eventgan {

/// A dataset whose boxes have outlines by the masks in SourceSpec::outlines, a folder: of an image
/// at its path below the root, with the ending .png in place of its own, or right in the folder
/// where no other labelled image has its name; of a video's frame 12 STEM/000012.png, with any
/// number of zeros. An image without mask keeps its boxes as they are, and a note counts these.
/// Throws InputError if there is no such folder, or none of the images has a mask.
std::unique_ptr<Dataset> with_outlines(std::unique_ptr<Dataset> dataset, const SourceSpec& spec,
                                       const std::filesystem::path& base);

}  // namespace eventgan
