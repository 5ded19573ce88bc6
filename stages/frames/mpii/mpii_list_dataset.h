#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"

namespace eventgan {

/// MPII as pose trainers keep it: the manifest's `annotations` is a JSON list of people ("image",
/// "center", "scale", "joints", "joints_vis") or an HDF5 table of them (valid.h5, train.h5).
/// Images are found by name in ROOT/images, then in ROOT. Rows of one image make one sample of
/// several persons, in the file's order.
///
/// Joints and centre become 0-based; centre and scale are otherwise as the file has them: those of
/// a table are already moved and multiplied by 1.25 (see parse_mpii_list_row). There are no head
/// boxes. Annotation::original is a JSON list of the image's rows with all their fields.
/// Persons are in pixels of the labelled frame, as those of open_mpii_dataset.
///
/// A list does not say which frame of a video was labelled. If the manifest gives `sequences`
/// (SEQUENCES/NAME/00000053.jpg, NAME being the image's), it is taken from
/// mpii_human_pose_v1_sequences_keyframes.mat beside the annotations, in or beside SEQUENCES, or in
/// ROOT; without that file it is the frame whose file is byte for byte that of the image, which
/// reads all of the sequences' file sizes. Images without such a frame, and all without
/// `sequences`, have no paired frames.
///
/// Relative paths start at `base`. Everything is read at opening. Throws UsageError without
/// `annotations`; InputError if a file or folder is missing or damaged.
std::unique_ptr<Dataset> open_mpii_list_dataset(const SourceSpec& spec,
                                                const std::filesystem::path& base);

/// The JSON lists and tables of people in ROOT and ROOT/annot, by name. Reads the .json and .h5
/// files there to find out, unless they are more than twenty or above 64 MiB.
std::vector<std::filesystem::path> find_mpii_lists(const std::filesystem::path& root);

extern const DatasetReader kMpiiListReader;

}  // namespace eventgan
