#pragma once

#include "manifests/values/datasets.h"
#include "manifests/values/rows.h"
#include "stages/frames/dataset/dataset_reader.h"
#include "stages/frames/events/dhp19_dataset.h"
#include "stages/frames/events/recording_dataset.h"
#include "stages/frames/human36m/human36m_dataset.h"
#include "stages/frames/kitti/kitti_object_dataset.h"
#include "stages/frames/kitti/kitti_raw_dataset.h"
#include "stages/frames/kitti/kitti_tracking_dataset.h"
#include "stages/frames/mpii/mpii_dataset.h"
#include "stages/frames/mpii/mpii_list_dataset.h"
#include "stages/frames/sequences/frames_dataset.h"

namespace eventgan {

/// Every kind's, in the order of kDatasets.
inline constexpr auto kDatasetReaders =
    parts_of<DatasetReader>(kDatasets, {{DatasetKind::kKittiObject, &kKittiObjectReader},
                                        {DatasetKind::kKittiTracking, &kKittiTrackingReader},
                                        {DatasetKind::kKittiRaw, &kKittiRawReader},
                                        {DatasetKind::kMpii, &kMpiiReader},
                                        {DatasetKind::kHuman36m, &kHuman36mReader},
                                        {DatasetKind::kMpiiList, &kMpiiListReader},
                                        {DatasetKind::kRecording, &kRecordingReader},
                                        {DatasetKind::kDhp19, &kDhp19Reader},
                                        {DatasetKind::kFrames, &kFramesReader}});

const DatasetReader& dataset_reader(DatasetKind kind);

}  // namespace eventgan
