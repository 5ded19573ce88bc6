#pragma once

#include <string>
#include <vector>

#include "manifests/labels.h"
#include "stages/scenes/road/road_scene.h"

namespace eventgan {

/// The text of a label file: a line for each vehicle, 15 columns, numbers with two decimals.
std::string kitti_labels(const std::vector<RoadLabel>& labels);

/// The text of a calibration file: all four cameras are this one.
std::string kitti_calibration(const Intrinsics& camera);

}  // namespace eventgan
