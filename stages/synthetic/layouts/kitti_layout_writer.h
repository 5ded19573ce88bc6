#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "manifests/values/labels.h"
#include "stages/synthetic/road_scene.h"

namespace eventgan {

/// The text of a label file: a line for each vehicle, 15 columns, numbers with two decimals.
std::string kitti_labels(const std::vector<RoadLabel>& labels);

/// The text of a calibration file: all four cameras are this one.
std::string kitti_calibration(const Intrinsics& camera);

/// The labelled frames that write_kitti_layout writes, by name: 12, or one of each scene.
std::vector<std::string> kitti_layout_names(int sequences);

/// Writes a drive (RoadScene) as KITTI's object set lays it out, 12 labelled frames with three
/// previous frames each: `root`/{image_2, prev_2, label_2, calib}; or, of `sequences` > 0, so many
/// drives with a labelled frame each, and then in between_2/NAME/ the intermediate frames
/// (write_intermediate_frames) from the frame before the labelled one to it. `on_frame` is called
/// after each labelled frame. Throws std::runtime_error naming the path.
void write_kitti_layout(
    const std::filesystem::path& root, std::uint64_t seed, int sequences = 0,
    int intermediate_count = 0, const std::function<void()>& on_frame = [] {});

}  // namespace eventgan
