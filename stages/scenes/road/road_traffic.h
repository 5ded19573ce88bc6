#pragma once

#include <cstdint>
#include <vector>

#include "stages/scenes/road/vehicle.h"

namespace eventgan {

inline constexpr double kFrameSeconds = 0.1;   ///< KITTI's 10 frames a second
inline constexpr double kCameraHeight = 1.65;  ///< above the road, m
inline constexpr double kCameraSpeed = 6.0;    ///< forward, m/s

/// All vehicles ahead of the camera at a frame: one ahead in the same lane, one being overtaken on
/// the right, oncoming ones on the left and parked ones on both sides. A pure function of seed and
/// frame.
std::vector<Vehicle> traffic(std::uint64_t seed, int frame);

}  // namespace eventgan
