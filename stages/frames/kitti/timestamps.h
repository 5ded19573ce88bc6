#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "manifests/faults.h"

namespace eventgan {

/// KITTI records at 10 Hz: seconds between frames where no timestamps are there.
inline constexpr double kKittiFrameSeconds = 0.1;

/// A timestamps.txt of KITTI raw: line i (from 0) holds "2011-09-26 13:02:25.594360375" for frame
/// i. Gives seconds since the first line, exact to the nanosecond; NaN for a blank line. A fault
/// that names `path` and the line for any other line, for a time that is not after those above it,
/// and for a last line that is cut short: without a line end, and shorter than the first.
Outcome<std::vector<double>> parse_timestamps(std::string_view text, const std::string& path);

}  // namespace eventgan
