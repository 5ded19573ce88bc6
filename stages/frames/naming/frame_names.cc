#include "stages/frames/naming/frame_names.h"

#include <utf8proc.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <memory>
#include <optional>
#include <span>

#include "stages/frames/listing/image_folder.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"
#include "stages/frames/naming/own_labels.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// One text for all the ways to write a name: its extension in small letters, accents apart.
std::string folded(std::string_view name) {
  const fs::path path(name);
  std::string text = (path.parent_path() / path.stem()).generic_string() + lower_extension(path);
  const bool is_ascii = std::ranges::all_of(text, [](char c) { return (c & 0x80) == 0; });
  if (is_ascii) return text;
  utf8proc_uint8_t* apart = nullptr;  // as macOS writes names (NFD)
  const auto size =
      utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(text.data()), std::ssize(text), &apart,
                   utf8proc_option_t(UTF8PROC_STABLE | UTF8PROC_DECOMPOSE));
  const std::unique_ptr<utf8proc_uint8_t, decltype(&std::free)> owner(apart, &std::free);
  if (size < 0) return text;  // not UTF-8
  return {reinterpret_cast<const char*>(apart), static_cast<std::size_t>(size)};
}

/// With / for Windows' \, and the letters that %20 and the like stand for.
std::string plain(std::string_view name) {
  const auto digit = [](char c) {
    const std::size_t place =
        std::string_view("0123456789abcdef")
            .find(static_cast<char>(c >= 'A' && c <= 'F' ? c - 'A' + 'a' : c));
    return place == std::string_view::npos ? -1 : static_cast<int>(place);
  };
  std::string text;
  for (std::size_t i = 0; i < name.size(); ++i) {
    const bool is_code =
        name[i] == '%' && i + 2 < name.size() && digit(name[i + 1]) >= 0 && digit(name[i + 2]) >= 0;
    if (is_code) {
      text += static_cast<char>(16 * digit(name[i + 1]) + digit(name[i + 2]));
      i += 2;
    } else {
      text += name[i] == '\\' ? '/' : name[i];
    }
  }
  return text;
}

/// The folders and the name of a path, without ".", ".." and what is before the first folder.
std::vector<std::string> parts_of(const std::string& name) {
  std::vector<std::string> parts;
  for (const fs::path& part : fs::path(name).lexically_normal()) {
    if (part.empty() || part == "/" || part == "." || part == "..") continue;
    parts.push_back(part.string());
  }
  return parts;
}

std::string joined(const std::vector<std::string>& parts, std::size_t first, std::size_t end) {
  std::string path;
  for (std::size_t i = first; i < end; ++i) path += (i > first ? "/" : "") + parts[i];
  return path;
}

std::string joined_from(const std::vector<std::string>& parts, std::size_t first) {
  return joined(parts, first, parts.size());
}

void add(std::unordered_map<std::string, std::size_t>& places, const std::string& name,
         std::size_t frame) {
  const auto [place, is_new] = places.emplace(name, frame);
  if (!is_new && place->second != frame) place->second = FrameNames::kSeveral;
}

/// "FOLDER/#12" of "FOLDER/in000012.png"; none if the name has no number.
std::optional<std::string> numbered_name(const fs::path& name) {
  const NumberInName found = find_number(name.stem().string());
  if (found.digits.empty()) return std::nullopt;
  return (name.parent_path() / ("#" + std::to_string(found.number))).generic_string();
}

}  // namespace

std::string video_frame_name(const std::string& name) {
  const fs::path path(name);
  const std::string stem = path.stem().string();
  if (stem.empty() || !std::ranges::all_of(stem, is_digit)) return "";
  const std::size_t zeros = std::min(stem.find_first_not_of('0'), stem.size() - 1);
  const fs::path above = path.parent_path();
  return ((is_video_name(above) ? above.parent_path() / above.stem() : above) / stem.substr(zeros))
      .generic_string();
}

std::string first_frame_name(const std::string& name) {
  const fs::path path(name);
  const NumberInName number = find_number(path.stem().string());
  if (number.digits.empty()) return "";
  return (path.parent_path() / (number.before + "0" + number.after)).generic_string();
}

bool names_no_video(std::string before) {
  constexpr std::array<std::string_view, 6> kWords = {"",         "frame",    "frames",
                                                      "frame_no", "frame_id", "frame_number"};
  before.erase(before.find_last_not_of("_-. ") + 1);
  return std::ranges::find(kWords, in_small_letters(before)) != kWords.end();
}

FrameNames::FrameNames(std::vector<std::string_view> names, const fs::path& root, bool is_video)
    : is_video_(is_video), root_(fs::absolute(root).lexically_normal()), names_(std::move(names)) {
  for (const fs::path& folder : root_) {
    if (!folder.empty()) root_folders_.push_back(folder.string());
  }
  by_path_.reserve(names_.size());
  by_bare_name_.reserve(names_.size());
  bool are_several_videos = false;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const std::string_view name = names_[i];
    by_path_.emplace(name, i);
    const auto [bare, is_new] = by_bare_name_.emplace(name.substr(name.rfind('/') + 1), i);
    // Of several videos a number alone is no frame, though only the longest may have so many.
    const bool is_other_video =
        is_video && name.substr(0, name.rfind('/')) != names_[0].substr(0, names_[0].rfind('/'));
    are_several_videos |= is_other_video;
    if (!is_new) bare->second = kSeveral;
  }
  if (are_several_videos) {
    for (auto& [name, place] : by_bare_name_) place = kSeveral;
  }
}

namespace {

std::vector<std::string_view> names_of(const LabelledSource& source) {
  std::vector<std::string_view> names;
  names.reserve(source.frames.size());
  for (const SourceFrame& frame : source.frames) names.push_back(frame.name);
  return names;
}

}  // namespace

FrameNames::FrameNames(const LabelledSource& source)
    : FrameNames(names_of(source), source.root.on_disk(""), source.is_video) {}

std::size_t FrameNames::look_up(const std::string& below_root) const {
  const std::string name = is_video_ ? video_frame_name(below_root) : below_root;
  const auto found = by_path_.find(name);
  if (found != by_path_.end()) return found->second;
  if (name.find('/') != std::string::npos) return kNone;
  const auto bare = by_bare_name_.find(name);
  return bare == by_bare_name_.end() ? kNone : bare->second;
}

FrameNames::Match FrameNames::find_exactly(const std::string& name) const {
  if (const auto found = by_path_.find(name); found != by_path_.end()) {
    return {found->second, name};
  }
  const fs::path path = fs::path(name).lexically_normal();
  Match match{look_up(path.generic_string()), path.generic_string()};
  if (match.frame != kNone) return match;
  const std::vector<std::string> parts(path.begin(), path.end());
  // The fewest folders first: of "a/b/1.jpg" under ".../a/b", those nearest the image count.
  for (std::size_t count = 1; count < parts.size() && count <= root_folders_.size(); ++count) {
    const bool fits = std::equal(parts.begin(), parts.begin() + static_cast<std::ptrdiff_t>(count),
                                 root_folders_.end() - static_cast<std::ptrdiff_t>(count));
    if (!fits) continue;
    match.below_root = joined_from(parts, count);
    // No bare name any more: "images/1.jpg" is right in the root "images", not in a folder of it.
    const auto found =
        by_path_.find(is_video_ ? video_frame_name(match.below_root) : match.below_root);
    if (found != by_path_.end()) match.frame = found->second;
    break;
  }
  return match;
}

FrameNames::Match FrameNames::find(const std::string& name) {
  Match match = find_exactly(name);
  if (match.frame != kNone || names_.empty()) return match;
  const bool is_in_root = match.below_root != fs::path(name).lexically_normal().generic_string();
  Match near = is_in_root ? find_near(match.below_root, true) : find_near(name, false);
  if (near.frame != kNone) {
    near.below_root = match.below_root;
    return near;
  }
  // Only of a name that says so: a part of a larger set is no sign of another place.
  const fs::path path = fs::path(plain(name)).lexically_normal();
  const bool leads_out = path.is_absolute() || (!path.empty() && *path.begin() == "..");
  match.is_elsewhere = leads_out && has_file(root_ / path);
  return match;
}

FrameNames::Match FrameNames::find_near(const std::string& name, bool is_in_root) {
  const std::vector<std::string> parts = parts_of(plain(name));
  if (parts.empty()) return {};
  if (is_video_) return find_near_in_video(parts);
  if (near_.empty()) list_near();
  const bool has_extension = fs::path(parts.back()).has_extension();
  if (!has_extension && stems_.empty()) list_stems();
  const Places& places = has_extension ? near_ : stems_;
  for (std::size_t dropped = 0; dropped < parts.size(); ++dropped) {
    const std::string rest = folded(joined_from(parts, dropped));
    auto found = places.find(rest);
    if (found == places.end() && !has_extension) {
      const auto number =
          std::ranges::all_of(parts.back(), is_digit) ? numbered_name(rest) : std::nullopt;
      if (number) found = places.find(*number);
    }
    if (found == places.end()) continue;
    const bool is_bare = dropped + 1 == parts.size();
    if (found->second == kSeveral) return dropped == 0 ? Match{kSeveral} : Match{};
    // As above: "images/1.jpg" is no image of a folder of the root "images", and "a/1.jpg" none of
    // the folder b.
    const bool is_in_folder = names_[found->second].find('/') != std::string_view::npos;
    if ((is_in_root || dropped > 0) && is_in_folder && is_bare) continue;
    const bool is_other = dropped > 0 && (is_other_sequence(parts, dropped) ||
                                          is_other_image(parts, dropped, found->second));
    if (is_other) return {};
    return {.frame = found->second, .is_near = true, .dropped = joined(parts, 0, dropped)};
  }
  return {};
}

/// "videos/STEM/12", and "STEM_000012.png", "STEM/frame_000012.png" and "frame_000012.png" as tools
/// name the images of a video.
FrameNames::Match FrameNames::find_near_in_video(const std::vector<std::string>& parts) {
  const auto match = [&](std::size_t frame, std::size_t dropped) -> Match {
    if (frame >= kSeveral) return {frame == kSeveral && dropped == 0 ? kSeveral : kNone};
    const std::string clip = fs::path(names_[frame]).parent_path().string();
    const bool has_clip = dropped > 0 && video_frame_name(parts[dropped - 1] + "/0") == clip + "/0";
    if (has_clip) --dropped;
    const auto is_other_clip = [&](const std::string& folder) {
      const std::size_t first = look_up(folder + "/0");
      return first < kSeveral && fs::path(names_[first]).parent_path() != clip;
    };
    const std::span front(parts.data(), dropped);
    const bool is_other =
        dropped > 0 && (std::ranges::any_of(front, is_other_clip) ||
                        is_other_sequence(parts, dropped) || is_other_image(parts, dropped, frame));
    if (is_other) return {};
    return {.frame = frame, .is_near = true, .dropped = joined(parts, 0, dropped)};
  };
  for (std::size_t dropped = 1; dropped + 1 < parts.size(); ++dropped) {
    const std::size_t frame = look_up(joined_from(parts, dropped));
    if (frame != kNone) return match(frame, dropped);
  }
  const auto [stem, digits, after, number, time] =
      find_number(fs::path(parts.back()).stem().string());
  if (stem.empty() || digits.empty() || !after.empty()) return {};
  const std::size_t folders = parts.size() - 1;
  const bool names_none = names_no_video(stem);
  std::size_t frame = kNone;
  if (names_none && folders > 0) frame = look_up(parts[folders - 1] + "/" + digits);
  if (frame == kNone) frame = look_up(stem.substr(0, stem.size() - 1) + "/" + digits);
  if (frame == kNone && names_none) frame = look_up(digits);  // of the only video
  return match(frame, folders);
}

namespace {

constexpr int kLevels = 3;  // from ROOT up, in which a name's folders may lie

bool is_number(std::string_view name) { return std::ranges::all_of(name, is_digit); }

/// A folder's name that says nothing of what is in it.
bool is_general(const std::string& name, bool of_videos) {
  constexpr std::array<std::string_view, 16> kGeneral = {
      "data", "dataset", "default",    "frames",   "image",  "images", "img",    "img1",
      "imgs", "media",   "jpegimages", "pictures", "photos", "rgb",    "upload", "uploads"};
  return !split_of(name).empty() || std::ranges::find(kGeneral, name) != kGeneral.end() ||
         (of_videos && (name == "clips" || name == "video" || name == "videos"));
}

/// "MOT17-02" and "MOT17-04", "seqA" and "seqB".
bool are_siblings(const std::string& a, const std::string& b) {
  const auto without_numbers = [](const std::string& name) {
    std::string text;
    for (const char c : name) {
      if (!is_digit(c)) text += c;
      if (is_digit(c) && !text.ends_with('#')) text += '#';
    }
    return text;
  };
  if (a == b) return false;
  const bool differ_last =
      a.size() == b.size() && a.size() > 2 && std::equal(a.begin(), a.end() - 1, b.begin());
  return differ_last || without_numbers(a) == without_numbers(b);
}

}  // namespace

bool FrameNames::is_other_sequence(const std::vector<std::string>& parts,
                                   std::size_t dropped) const {
  constexpr std::size_t kNearest = 3;
  std::vector<std::string> own;  // the last first
  for (auto folder = root_folders_.rbegin(); folder != root_folders_.rend(); ++folder) {
    if (own.size() < kNearest) own.push_back(in_small_letters(*folder));
  }
  if (own.empty()) return false;
  std::string last;  // that is no number
  for (std::size_t i = 0; i < dropped; ++i) {
    const std::string name = in_small_letters(parts[i]);
    const bool is_own = std::ranges::find(own, name) != own.end();
    const auto is_sibling = [&](const std::string& folder) { return are_siblings(name, folder); };
    // A number is a task's or a sequence's, which only a root tells that is one as well.
    if (!is_own && !is_general(name, is_video_) &&
        (is_number(name) ? is_number(own.front()) : std::ranges::any_of(own, is_sibling))) {
      return true;
    }
    if (!is_number(name)) last = is_own ? "" : name;
  }
  return !last.empty() && !is_general(last, is_video_) && !is_general(own.front(), is_video_);
}

/// Whether folders that were dropped from a name tell that it is of another image: of another
/// split, or there in another place.
bool FrameNames::is_other_image(const std::vector<std::string>& parts, std::size_t dropped,
                                std::size_t frame) {
  std::string_view own;
  for (const fs::path& folder : (root_ / fs::path(names_[frame]).parent_path())) {
    if (const auto split = split_of(folder.string()); !split.empty()) own = split;
  }
  for (std::size_t i = 0; i < dropped; ++i) {
    const std::string_view split = split_of(parts[i]);
    if (!split.empty() && !own.empty() && split != own) return true;
  }
  if (is_video_) {
    const std::string folders = joined(parts, 0, dropped);
    const std::string stem = fs::path(names_[frame]).parent_path().string();
    const auto [other, is_new] = other_videos_.try_emplace(folders + "/" + stem);
    if (is_new) other->second = has_other_video(folders, stem);
    return other->second;
  }
  fs::path above = root_;
  const std::string path = joined_from(parts, 0);
  for (int level = 0; level < kLevels; ++level, above = above.parent_path()) {
    std::error_code unknown;
    if (has_file(above / path) && !fs::equivalent(above / path, root_ / names_[frame], unknown)) {
      return true;
    }
  }
  return false;
}

/// Whether a video of that name, which is not the one in ROOT, lies in these folders.
bool FrameNames::has_other_video(const std::string& folders, const std::string& stem) const {
  fs::path above = root_;
  for (int level = 0; level < kLevels; ++level, above = above.parent_path()) {
    for (const fs::path name : look_into(above / folders).files) {
      std::error_code unknown;
      if (is_video_name(name) && name.stem() == stem &&
          !fs::equivalent(above / folders / name, root_ / name, unknown)) {
        return true;
      }
    }
  }
  return false;
}

void FrameNames::list_near() {
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const std::string name = folded(names_[i]);
    add(near_, name, i);
    if (name.find('/') != std::string::npos) add(near_, name.substr(name.rfind('/') + 1), i);
  }
}

void FrameNames::list_stems() {
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const fs::path name(folded(names_[i]));
    for (const fs::path& path : {name, name.filename()}) {
      add(stems_, (path.parent_path() / path.stem()).generic_string(), i);
      if (const auto of_it = numbered_name(path)) add(stems_, *of_it, i);
    }
  }
}

}  // namespace eventgan
