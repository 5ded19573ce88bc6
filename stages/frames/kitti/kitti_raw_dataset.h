#pragma once

#include <filesystem>
#include <memory>

#include "manifests/values/job.h"
#include "stages/frames/dataset/dataset.h"
#include "stages/frames/dataset/dataset_reader.h"

namespace eventgan {

/// KITTI raw, synchronised and rectified: DATE/DATE_drive_NNNN_sync below the root, each with
/// image_02/data and perhaps image_02/timestamps.txt and tracklet_labels.xml; DATE/calib_*.txt
/// beside them. Every image is a labelled frame: without tracklets its annotation is empty, with
/// them `original` is TrackletFrame::json, and there are boxes if the date's calibration is there.
/// So is a frame inside a drive that has tracklets and no image. All frames of a drive whose
/// timestamps are damaged are at fault.
/// sample_id "2011_09_26_drive_0052_sync/0000000007".
std::unique_ptr<Dataset> open_kitti_raw_dataset(const SourceSpec& spec,
                                                const std::filesystem::path& base);

/// Whether KITTI raw lies there, by its folders' names.
bool is_kitti_raw(const std::filesystem::path& root);

extern const DatasetReader kKittiRawReader;

}  // namespace eventgan
