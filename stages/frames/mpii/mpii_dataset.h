#pragma once

#include <filesystem>
#include <memory>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"

namespace eventgan {

/// MPII Human Pose as downloaded.
///
/// ROOT/mpii_human_pose_v1_u12_1.mat, or in ROOT/mpii_human_pose_v1_u12_2/, or the manifest's
/// `annotations` (file or folder); mpii_human_pose_v1_sequences_keyframes.mat beside it or in ROOT,
/// which stills and a ROOT without videos need not have; ROOT/images; the videos in ROOT/sequences
/// and ROOT/mpii_human_pose_v1_sequences_batchN, or only in the manifest's `sequences`.
///
/// A sample is an image in which somebody has a joint or a centre, named as the image without
/// extension. `split` train takes only img_train 1, test only img_train 0, any other name both.
/// Persons are those of annorect, in its order, also such as have no joints. Annotation::original
/// is MpiiEntry::json.
/// Where the frame of a sequence is stored in another size than images/NAME, which was annotated,
/// persons are in pixels of the frame (MpiiFrames::label_scale).
///
/// Relative paths start at `base`. The .mat files are read at opening. Throws
/// InputError if a .mat file or the root is missing or damaged, or two images have one name.
std::unique_ptr<Dataset> open_mpii_dataset(const SourceSpec& spec,
                                           const std::filesystem::path& base);

extern const DatasetReader kMpiiReader;

}  // namespace eventgan
