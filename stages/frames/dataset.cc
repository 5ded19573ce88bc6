#include "stages/frames/dataset.h"

#include <stdexcept>

#include "stages/frames/human36m/human36m_dataset.h"
#include "stages/frames/kitti/kitti_object_dataset.h"
#include "stages/frames/kitti/kitti_raw_dataset.h"
#include "stages/frames/kitti/kitti_tracking_dataset.h"
#include "stages/frames/mpii/mpii_dataset.h"
#include "stages/frames/mpii/mpii_list_dataset.h"
#include "stages/frames/sequences/frames_dataset.h"

namespace eventgan {

std::unique_ptr<Dataset> open_dataset(const SourceSpec& spec, const std::filesystem::path& base) {
  switch (spec.dataset) {
    case DatasetKind::kKittiObject:
      return open_kitti_object_dataset(spec, base);
    case DatasetKind::kKittiTracking:
      return open_kitti_tracking_dataset(spec, base);
    case DatasetKind::kKittiRaw:
      return open_kitti_raw_dataset(spec, base);
    case DatasetKind::kMpii:
      return open_mpii_dataset(spec, base);
    case DatasetKind::kMpiiList:
      return open_mpii_list_dataset(spec, base);
    case DatasetKind::kHuman36m:
      return open_human36m_dataset(spec, base);
    case DatasetKind::kFrames:
      return open_frames_dataset(spec, base);
  }
  throw std::logic_error("open_dataset: not a kind of dataset");
}

}  // namespace eventgan
