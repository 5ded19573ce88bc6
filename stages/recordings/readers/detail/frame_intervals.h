#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace eventgan {

/// Throws InputError unless there is a frame and the times are finite and strictly ascending;
/// `place` is where they are: "expected X, got Y, in PLACE (frame 3)".
void check_frame_times(const std::vector<double>& times_s, const std::string& place);

/// Two frames of a recording as positions in a vector, `first` ≤ `last`.
struct FrameRange {
  std::size_t first = 0;
  std::size_t last = 0;
};

/// Both throw std::out_of_range naming the recording if there is no such frame or range.
std::size_t frame_position(std::int64_t index, std::int64_t count, const std::string& recording);
FrameRange frame_range(std::int64_t first, std::int64_t last, std::int64_t count,
                       const std::string& recording);

}  // namespace eventgan
