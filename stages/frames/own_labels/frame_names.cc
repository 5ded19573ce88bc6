#include "stages/frames/own_labels/detail/frame_names.h"

#include <algorithm>

#include "stages/frames/numbered_sequence.h"

namespace eventgan {

namespace fs = std::filesystem;

std::string video_frame_name(const std::string& name) {
  const fs::path path(name);
  const std::string stem = path.stem().string();
  if (stem.empty() || !std::ranges::all_of(stem, is_digit)) return "";
  const std::size_t zeros = std::min(stem.find_first_not_of('0'), stem.size() - 1);
  return (path.parent_path() / stem.substr(zeros)).generic_string();
}

FrameNames::FrameNames(const LabelledSource& source) : is_video_(source.is_video) {
  const fs::path root = fs::absolute(source.root.on_disk("")).lexically_normal();
  for (const fs::path& folder : root) {
    if (!folder.empty()) root_folders_.push_back(folder.string());
  }
  by_path_.reserve(source.frames.size());
  by_bare_name_.reserve(source.frames.size());
  for (std::size_t i = 0; i < source.frames.size(); ++i) {
    const std::string_view name = source.frames[i].name;
    by_path_.emplace(name, i);
    const auto [bare, is_new] = by_bare_name_.emplace(name.substr(name.rfind('/') + 1), i);
    if (!is_new) bare->second = kSeveral;
  }
}

std::size_t FrameNames::look_up(const std::string& below_root) const {
  const std::string name = is_video_ ? video_frame_name(below_root) : below_root;
  const auto found = by_path_.find(name);
  if (found != by_path_.end()) return found->second;
  if (name.find('/') != std::string::npos) return kNone;
  const auto bare = by_bare_name_.find(name);
  return bare == by_bare_name_.end() ? kNone : bare->second;
}

FrameNames::Match FrameNames::find(const std::string& name) const {
  const fs::path path = fs::path(name).lexically_normal();
  Match match{look_up(path.generic_string()), path.generic_string()};
  if (match.frame != kNone) return match;
  const std::vector<std::string> parts(path.begin(), path.end());
  // The fewest folders first: of "a/b/1.jpg" under ".../a/b", those nearest the image count.
  for (std::size_t count = 1; count < parts.size() && count <= root_folders_.size(); ++count) {
    const bool fits = std::equal(parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(count),
                                 root_folders_.end() - static_cast<std::ptrdiff_t>(count));
    if (!fits) continue;
    fs::path rest;
    for (std::size_t i = count; i < parts.size(); ++i) rest /= parts[i];
    match.below_root = rest.generic_string();
    // No bare name any more: "images/1.jpg" is right in the root "images", not in a folder of it.
    const auto found =
        by_path_.find(is_video_ ? video_frame_name(match.below_root) : match.below_root);
    if (found != by_path_.end()) match.frame = found->second;
    break;
  }
  return match;
}

}  // namespace eventgan
