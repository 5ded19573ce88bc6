#pragma once

#include <array>

#include "manifests/values/datasets.h"
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
inline constexpr std::array kDatasetReaders{
    &kKittiObjectReader, &kKittiTrackingReader, &kKittiRawReader, &kMpiiReader,  &kHuman36mReader,
    &kMpiiListReader,    &kRecordingReader,     &kDhp19Reader,    &kFramesReader};
static_assert(kDatasetReaders.size() == kDatasets.size());

const DatasetReader& dataset_reader(DatasetKind kind);

}  // namespace eventgan
