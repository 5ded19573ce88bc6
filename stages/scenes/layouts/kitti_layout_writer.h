#pragma once

#include <cstdint>
#include <filesystem>

namespace eventgan {

/// Writes a drive (RoadScene) as KITTI's object set lays it out, 12 labelled frames with three
/// previous frames each: `root`/{image_2, prev_2, label_2, calib}. Throws std::runtime_error naming
/// the path.
void write_kitti_layout(const std::filesystem::path& root, std::uint64_t seed);

}  // namespace eventgan
