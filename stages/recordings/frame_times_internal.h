#pragma once

#include <string>
#include <vector>

namespace eventgan {

/// Throws InputError unless there is a frame and the times are finite and strictly ascending;
/// `place` is where they stand: "expected X, got Y, in PLACE (frame 3)".
void check_frame_times(const std::vector<double>& times_s, const std::string& place);

}  // namespace eventgan
