#include <stdexcept>

#include "stages/recordings/frame_range_internal.h"

namespace eventgan {

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
