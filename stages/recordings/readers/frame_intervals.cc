#include "stages/recordings/readers/detail/frame_intervals.h"

#include <cmath>
#include <cstddef>
#include <stdexcept>

#include "manifests/values/faults.h"

namespace eventgan {

void check_frame_times(const std::vector<double>& times_s, const std::string& place) {
  if (times_s.empty()) throw InputError("expected at least one frame, got none, in " + place);
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    const std::string at = ", in " + place + " (frame " + std::to_string(i) + ")";
    if (!std::isfinite(times_s[i])) {
      throw InputError("expected a finite time, got " + std::to_string(times_s[i]) + at);
    }
    if (i > 0 && times_s[i] <= times_s[i - 1]) {
      throw InputError("expected a time after " + std::to_string(times_s[i - 1]) + " s, got " +
                       std::to_string(times_s[i]) + " s" + at);
    }
  }
}

std::size_t frame_position(std::int64_t index, std::int64_t count, const std::string& recording) {
  if (index >= 0 && index < count) return static_cast<std::size_t>(index);
  throw std::out_of_range("expected a frame 0.." + std::to_string(count - 1) + ", got " +
                          std::to_string(index) + ", in " + recording);
}

FrameRange frame_range(std::int64_t first, std::int64_t last, std::int64_t count,
                       const std::string& recording) {
  const FrameRange range{frame_position(first, count, recording),
                         frame_position(last, count, recording)};
  if (range.first <= range.last) return range;
  throw std::out_of_range("expected the earlier frame first, got " + std::to_string(first) +
                          " and " + std::to_string(last) + ", in " + recording);
}

}  // namespace eventgan
