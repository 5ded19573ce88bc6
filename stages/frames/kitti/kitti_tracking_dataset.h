#pragma once

#include <filesystem>
#include <memory>

#include "manifests/job_manifest.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// KITTI tracking: image_02/SEQ/NNNNNN.png and label_02/SEQ.txt below the root, at 10 Hz. In a
/// sequence with a label file every picture is a labelled frame (without objects if no line names
/// it), and so is every frame that a line names. sample_id "0001/000012", label_key
/// "label_02/0001.txt#12".
std::unique_ptr<Dataset> open_kitti_tracking_dataset(const SourceSpec& spec,
                                                     const std::filesystem::path& base);

}  // namespace eventgan
