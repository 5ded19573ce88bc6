#include "stages/frames/listing/image_folder.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "manifests/files/input_file.h"
#include "manifests/files/own_file.h"
#include "manifests/values/faults.h"
#include "stages/frames/listing/numbered_sequence.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {

std::string lower_extension(const std::filesystem::path& file) {
  return in_small_letters(file.extension().string());
}

bool is_video_name(const std::filesystem::path& file) {
  return std::ranges::find(kVideoExtensions, lower_extension(file)) != kVideoExtensions.end();
}

namespace {

/// Cuts the run of digits that `text` starts with off it; the run without its leading zeros.
std::string_view take_number(std::string_view& text) {
  const auto end =
      static_cast<std::size_t>(std::ranges::find_if_not(text, is_digit) - text.begin());
  std::string_view digits = text.substr(0, end);
  text.remove_prefix(end);
  digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
  return digits;
}

}  // namespace

bool natural_less(std::string_view a, std::string_view b) {
  std::string_view rest_a = a, rest_b = b;
  while (!rest_a.empty() && !rest_b.empty()) {
    if (is_digit(rest_a.front()) && is_digit(rest_b.front())) {
      const std::string_view number_a = take_number(rest_a), number_b = take_number(rest_b);
      if (number_a.size() != number_b.size()) return number_a.size() < number_b.size();
      if (number_a != number_b) return number_a < number_b;
      continue;
    }
    if (rest_a.front() != rest_b.front()) {
      return static_cast<unsigned char>(rest_a.front()) <
             static_cast<unsigned char>(rest_b.front());
    }
    rest_a.remove_prefix(1);
    rest_b.remove_prefix(1);
  }
  if (rest_a.empty() != rest_b.empty()) return rest_a.empty();
  return a < b;
}

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBeforePixels = 4096;  // of a PNG: the mark stands there

/// The place of the extension in kImageExtensions; its size if it is none of them.
std::size_t extension_rank(const fs::path& name) {
  return static_cast<std::size_t>(std::ranges::find(kImageExtensions, lower_extension(name)) -
                                  kImageExtensions.begin());
}

/// Stem to file name, stems in natural order.
using Images = std::map<std::string, std::string, decltype(&natural_less)>;

NumberedSequence number(const Images& images) {
  constexpr std::int64_t kMostNumber = 1'000'000'000'000'000'000;
  std::vector<NumberedSequence::Frame> numbered, counted;
  std::set<std::int64_t> numbers;
  std::optional<NumberInName> first;
  bool all_numbered = true;
  for (const auto& [stem, name] : images) {
    counted.emplace_back(static_cast<std::int64_t>(counted.size()), name);
    const NumberInName found = find_number(stem);
    if (!first) first = found;
    all_numbered = all_numbered && !found.digits.empty() && found.before == first->before &&
                   found.after == first->after && found.number < kMostNumber &&
                   numbers.insert(found.number).second;
    if (all_numbered) numbered.emplace_back(found.number, name);
  }
  return NumberedSequence(all_numbered ? std::move(numbered) : std::move(counted),
                          NumberedSequence::Stride::kInferred);
}

bool is_png(const fs::path& name) { return lower_extension(name) == ".png"; }

bool is_own_picture(const fs::path& file) try {
  std::string reason, start(kBeforePixels, '\0');
  const auto opened = InputFile::open(file, reason);
  if (!opened) return false;  // said where it is read
  start.resize(opened->read_some(0, start));
  return has_own_mark(start);
} catch (const InputError&) {
  return false;  // said where it is read
}

}  // namespace

ImageFolder list_image_folder(const fs::path& folder) {
  const auto is_hidden = [](const std::string& name) { return name.starts_with('.'); };
  auto [folders, files, passed_over] = list_folder(folder);
  std::erase_if(folders, is_hidden);
  std::erase_if(files, is_hidden);

  ImageFolder listed;
  listed.folders = std::move(folders);
  listed.left_out = std::move(passed_over);
  const auto first_png = std::ranges::find_if(files, is_png);
  const auto last_png = std::find_if(files.rbegin(), files.rend(), is_png);
  if (first_png != files.end() &&
      (is_own_picture(folder / *first_png) || is_own_picture(folder / *last_png))) {
    std::erase_if(files, [&](const std::string& name) {
      if (!is_png(name) || !is_own_picture(folder / name)) return false;
      listed.left_out.push_back(name + " (eventgan's picture)");
      return true;
    });
  }
  Images images(natural_less);
  for (const fs::path name : files) {
    const std::size_t rank = extension_rank(name);
    if (rank == kImageExtensions.size()) {
      const bool counts = lower_extension(name) == ".json" &&
                          listed.sidecars.try_emplace(name.stem().string(), name.string()).second;
      if (!counts) listed.left_out.push_back(name.string());
      continue;
    }
    // Files come sorted: most stems are the last ones so far, and the hint spares a search.
    const std::size_t before = images.size();
    const auto image = images.try_emplace(images.end(), name.stem().string(), name.string());
    if (images.size() > before) continue;
    std::string other = name.string();
    // A PNG may be the other's mask. "a.png" and "a.PNG" are of one rank: the one whose name comes
    // first counts.
    const auto precedence = [](const fs::path& file) {
      return std::tuple(is_png(file), extension_rank(file), file.string());
    };
    if (precedence(other) < precedence(image->second)) {
      image->second.swap(other);
    }
    listed.left_out.push_back(std::move(other));
  }
  std::ranges::sort(listed.left_out);
  // A folder in a label's place is a label that cannot be read, not one that is not there.
  std::erase_if(listed.folders, [&](const fs::path& name) {
    return lower_extension(name) == ".json" && images.contains(name.stem().string()) &&
           listed.sidecars.try_emplace(name.stem().string(), name.string()).second;
  });
  listed.frames = number(images);
  return listed;
}

namespace {

bool is_label_folder(const std::string& name) {
  constexpr std::array<std::string_view, 4> kNames{"masks", "instances", "annotations", "labels"};
  // KITTI's flow and stereo: flow_occ, disp_noc_0, viz_flow_occ_dilate_1
  constexpr std::array<std::string_view, 7> kBeginnings{
      "flow_occ", "flow_noc", "disp_occ", "disp_noc", "disp_refl", "viz_flow", "obj_map"};
  const std::string small = in_small_letters(name);
  return std::ranges::find(kNames, small) != kNames.end() ||
         std::ranges::any_of(kBeginnings,
                             [&](std::string_view word) { return small.starts_with(word); });
}

bool has_images_or_videos(const fs::path& folder, int levels) {
  const FolderListing listing = look_into(folder);
  const auto is_one = [](const fs::path& name) {
    return !name.string().starts_with('.') &&
           (is_video_name(name) || extension_rank(name) < kImageExtensions.size());
  };
  const auto has_some = [&](const std::string& name) {
    return !name.starts_with('.') && !is_label_folder(name) &&
           has_images_or_videos(folder / name, levels - 1);
  };
  return std::ranges::any_of(listing.files, is_one) ||
         (levels > 0 && std::ranges::any_of(listing.folders, has_some));
}

}  // namespace

void drop_label_folders(const fs::path& root, std::vector<std::string>& names) {
  constexpr int kDeep = 2;
  const bool has_some = std::ranges::any_of(names, is_label_folder);
  if (has_some && has_images_or_videos(root, kDeep)) std::erase_if(names, is_label_folder);
}

void require_no_images(const fs::path& folder) {
  const auto refuse = [&](const std::string& name) {
    throw UsageError("expected a folder without images or videos that eventgan did not draw, got " +
                     name + ", in " + folder.string() + " (choose another folder to write to)");
  };
  const ImageFolder listed = list_image_folder(folder);
  if (!listed.frames.empty()) refuse(listed.frames.frames().front().second);
  for (const std::string& name : listed.left_out) {
    if (is_video_name(name) && !is_replaceable(folder / name, OwnFile::kVideo)) refuse(name);
  }
}

namespace {

/// The images whose names are alike but for their number.
struct AlikeImages {
  std::vector<NumberedSequence::Frame> frames;  ///< ascending by number
  std::vector<std::int64_t> times_ns;
  bool have_numbers = true;  ///< one without counts as 0

  bool are_times() const {
    return are_distinct() && std::ranges::none_of(times_ns, [](auto time) { return time < 0; }) &&
           std::ranges::is_sorted(times_ns);
  }
  /// Their numbers tell which frames are missing.
  bool are_numbered() const {
    constexpr std::int64_t kMostNumber = 100'000'000'000;
    return are_distinct() && !are_times() && frames.back().first < kMostNumber;
  }

 private:
  bool are_distinct() const {
    return std::ranges::adjacent_find(frames, {}, &NumberedSequence::Frame::first) == frames.end();
  }
};

NamedSequence count_frames(std::vector<NumberedSequence::Frame> frames) {
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i].first = static_cast<std::int64_t>(i);
  NamedSequence counted;
  counted.frames = NumberedSequence(std::move(frames));
  return counted;
}

std::int64_t smallest_step(const std::vector<NumberedSequence::Frame>& frames) {
  return NumberedSequence(frames, NumberedSequence::Stride::kInferred).stride();
}

/// `folder_step`: one step of two frames alone.
NamedSequence sequence_of(AlikeImages images, std::int64_t folder_step) {
  std::vector<NumberedSequence::Frame>& frames = images.frames;
  if (!images.are_numbered()) {
    const bool are_times = images.are_times();
    NamedSequence counted = count_frames(std::move(frames));
    for (const std::int64_t time : are_times ? images.times_ns : std::vector<std::int64_t>()) {
      counted.times_s.push_back(static_cast<double>(time - images.times_ns.front()) * 1e-9);
    }
    return counted;
  }
  NamedSequence numbered;
  numbered.is_numbered = images.have_numbers;
  const std::int64_t step = frames.size() == 2 ? folder_step : smallest_step(frames);
  numbered.frames = NumberedSequence(std::move(frames), step);
  return numbered;
}

/// Without what only parts it from the number.
std::string trimmed_end(std::string text) {
  text.erase(text.find_last_not_of("_-. ") + 1);
  return text;
}

}  // namespace

NamedSequences name_sequences(const NumberedSequence& images) {
  NamedSequences result;
  if (images.empty()) return result;
  std::vector<std::pair<NumberInName, std::string>> names;
  for (const auto& [place, name] : images.frames()) {
    names.emplace_back(find_number(fs::path(name).stem().string()), name);
  }
  std::ranges::stable_sort(names, {}, [](const auto& one) { return one.first.number; });
  std::map<std::pair<std::string, std::string>, AlikeImages> alike;
  for (const auto& [number, name] : names) {
    AlikeImages& same = alike[{number.before, number.after}];
    same.frames.emplace_back(number.number, name);
    same.times_ns.push_back(number.time_ns);
    same.have_numbers = same.have_numbers && !number.digits.empty();
  }
  std::size_t alone = 0;
  std::int64_t folder_step = std::numeric_limits<std::int64_t>::max();
  for (const auto& [around, same] : alike) {
    alone += same.frames.size() == 1;
    if (same.frames.size() > 1 && same.are_numbered()) {
      folder_step = std::min(folder_step, smallest_step(same.frames));
    }
  }
  if (alike.size() > 1 && 2 * alone > names.size()) {
    result.sequences.push_back(count_frames(images.frames()));
    result.are_told = false;
    return result;
  }
  std::set<std::string> taken;
  for (auto& [around, same] : alike) {
    NamedSequence& sequence =
        result.sequences.emplace_back(sequence_of(std::move(same), folder_step));
    std::tie(sequence.before, sequence.after) = around;
    if (alike.size() == 1) continue;
    sequence.is_only = false;
    sequence.name = trimmed_end(sequence.before);
    const bool is_plain = sequence.after.empty() || !sequence.name.empty();
    if (!is_plain || !taken.insert(sequence.name).second) {
      sequence.name = sequence.before + "*" + sequence.after;
    }
  }
  std::ranges::sort(result.sequences, {}, &NamedSequence::name);
  return result;
}

}  // namespace eventgan
