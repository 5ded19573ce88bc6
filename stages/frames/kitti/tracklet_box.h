#pragma once

#include <optional>

#include "manifests/labels.h"
#include "stages/frames/kitti/raw_calibration.h"
#include "stages/frames/kitti/tracklets.h"

namespace eventgan {

/// The tracklet as KITTI object would annotate it: the smallest upright rectangle around what the
/// camera sees of its cuboid, cut at 0 and at the last pixel's centre (width - 1, height - 1),
/// where KITTI's own labels end; box3d with the middle of the underside in the rectified frame.
/// Nothing if it lies behind the camera or outside the picture. `truncation` is 0 if the annotators
/// marked it as inside the picture, else unknown.
std::optional<Box> to_box(const TrackletPose& pose, const RawCalibration& calibration);

}  // namespace eventgan
