#pragma once

#include <filesystem>
#include <memory>

#include "manifests/job_manifest.h"
#include "stages/frames/dataset.h"

namespace eventgan {

/// KITTI object: label_2/NNNNNN.txt, image_2/NNNNNN.png, prev_2/NNNNNN_0K.png (K = 1..3, the frame
/// K before) below the root. Every label file is a labelled frame, its sample_id the file's name
/// without ".txt".
///
/// With `raw_root` and `devkit`, devkit/mapping leads to the raw drive: FrameRef::index is then the
/// raw frame's number and `sequence` the drive, and neighbours come from prev_2 where it has them
/// (its pictures are those of the raw drive, pixel for pixel), else from the drive. Without, index
/// is 0 for the labelled frame and -K for the frame K before. Times are the drive's timestamps, or
/// 0.1 s a frame.
///
/// What the mapping says is compared with what is stored: of each drive one picture, labelled or
/// previous, with the raw frame it should be, and the pixels must be equal. Where they are not,
/// where a previous picture would come before the drive's first frame, and where the drive's
/// timestamps are damaged, the frames are at fault (LabelledFrame::fault).
///
/// Throws UsageError if only one of `raw_root` and `devkit` is given.
std::unique_ptr<Dataset> open_kitti_object_dataset(const SourceSpec& spec,
                                                   const std::filesystem::path& base);

}  // namespace eventgan
