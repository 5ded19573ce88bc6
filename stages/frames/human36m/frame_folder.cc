#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "stages/frames/human36m/frame_folder_internal.h"

namespace eventgan {

FrameFolder::FrameFolder(std::string folder, std::string prefix, NumberedSequence stored,
                         const std::vector<std::int64_t>& labelled)
    : folder_(std::move(folder)),
      prefix_(std::move(prefix)),
      stored_(std::move(stored)),
      numbers_(labelled) {
  for (const auto& [number, name] : stored_.frames()) numbers_.push_back(number);
  std::ranges::sort(numbers_);
  const auto repeated = std::ranges::unique(numbers_);
  numbers_.erase(repeated.begin(), repeated.end());
}

FrameRef FrameFolder::frame(std::int64_t number) const {
  std::string name = stored_.at(number, 0).name;
  if (name.empty()) name = fmt::format("{}{:06}.jpg", prefix_, number);
  return {.path = folder_ + "/" + name,
          .index = number,
          .video_frame = -1,
          .time_s = static_cast<double>(number - 1) / kHuman36mFramesPerSecond};
}

Neighbour FrameFolder::neighbour(std::int64_t number, int steps) const {
  const auto here = std::ranges::lower_bound(numbers_, number);
  const bool is_known = here != numbers_.end() && *here == number;
  if (steps == 0 && !is_known) return {Neighbour::State::kHole, frame(number)};
  const std::ptrdiff_t place =
      here - numbers_.begin() + (steps > 0 && !is_known ? steps - 1 : steps);
  if (place < 0 || place >= std::ssize(numbers_)) return {};
  const std::int64_t target = numbers_[static_cast<std::size_t>(place)];
  return {stored_.contains(target) ? Neighbour::State::kPresent : Neighbour::State::kHole,
          frame(target)};
}

}  // namespace eventgan
