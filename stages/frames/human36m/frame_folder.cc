#include <algorithm>
#include <utility>

#include "stages/frames/human36m/frame_folder_internal.h"
#include "stages/frames/padded_number.h"

namespace eventgan {

FrameFolder::FrameFolder(std::string folder, std::string prefix, NumberedSequence stored,
                         const std::vector<std::int64_t>& labelled)
    : folder_(std::move(folder)), prefix_(std::move(prefix)), stored_(std::move(stored)) {
  std::vector<std::int64_t> numbers = labelled;
  for (const auto& [number, name] : stored_.frames()) numbers.push_back(number);
  if (numbers.empty()) return;
  const auto [first, last] = std::ranges::minmax(numbers);
  first_ = first;
  last_ = last;
  stride_ = stored_.stride();
  if (stored_.frames().size() >= 2) return;
  // Next to nothing is stored: the labels tell better how the video was sampled.
  std::ranges::sort(numbers);
  numbers.erase(std::ranges::unique(numbers).begin(), numbers.end());
  std::vector<NumberedSequence::Frame> frames;
  for (const std::int64_t one : numbers) frames.emplace_back(one, "");
  stride_ = NumberedSequence(std::move(frames), NumberedSequence::Stride::kInferred).stride();
}

FrameRef FrameFolder::frame(std::int64_t number) const {
  std::string name = stored_.at(number, 0).name;
  if (name.empty()) name = prefix_ + padded_number(number) + ".jpg";
  return {.path = folder_ + "/" + name,
          .index = number,
          .video_frame = -1,
          .time_s = static_cast<double>(number - 1) / kHuman36mFramesPerSecond};
}

Neighbour FrameFolder::neighbour(std::int64_t number, int steps) const {
  const std::int64_t target = number + steps * stride_;
  if (stored_.contains(target)) return {Neighbour::State::kPresent, frame(target)};
  if (steps != 0 && (target < first_ || target > last_)) return {};
  return {Neighbour::State::kHole, frame(target)};
}

}  // namespace eventgan
