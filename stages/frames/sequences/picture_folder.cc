#include "stages/frames/sequences/picture_folder.h"

#include <algorithm>
#include <charconv>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "stages/frames/folder_listing.h"
#include "stages/frames/sequences/lower_extension.h"
#include "stages/frames/sequences/natural_order.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;

/// The place of the extension in kPictureExtensions; its size if it is none of them.
std::size_t extension_rank(const fs::path& name) {
  return static_cast<std::size_t>(std::ranges::find(kPictureExtensions, lower_extension(name)) -
                                  kPictureExtensions.begin());
}

/// A stem's last run of digits, and what stands before it.
struct NumberedStem {
  std::string_view prefix;
  std::int64_t number = 0;
};

std::optional<NumberedStem> parse_stem(std::string_view stem) {
  constexpr std::size_t kMaxDigits = 18;
  const std::size_t before = stem.find_last_not_of("0123456789");
  const std::size_t begin = before == std::string_view::npos ? 0 : before + 1;
  const std::string_view digits = stem.substr(begin);
  if (digits.empty() || digits.size() > kMaxDigits) return std::nullopt;
  NumberedStem parsed{stem.substr(0, begin), 0};
  std::from_chars(digits.data(), digits.data() + digits.size(), parsed.number);
  return parsed;
}

/// Stem to file name, stems in natural order.
using Pictures = std::map<std::string, std::string, decltype(&natural_less)>;

NumberedSequence number(const Pictures& pictures) {
  std::vector<NumberedSequence::Frame> numbered, counted;
  std::set<std::int64_t> numbers;
  std::optional<std::string_view> prefix;
  bool all_numbered = true;
  for (const auto& [stem, name] : pictures) {
    counted.emplace_back(static_cast<std::int64_t>(counted.size()), name);
    const auto parsed = parse_stem(stem);
    if (parsed && !prefix) prefix = parsed->prefix;
    all_numbered =
        all_numbered && parsed && parsed->prefix == prefix && numbers.insert(parsed->number).second;
    if (all_numbered) numbered.emplace_back(parsed->number, name);
  }
  return NumberedSequence(all_numbered ? std::move(numbered) : std::move(counted),
                          NumberedSequence::Stride::kInferred);
}

}  // namespace

PictureFolder list_picture_folder(const fs::path& folder) {
  const auto is_hidden = [](const std::string& name) { return name.starts_with('.'); };
  auto [folders, files] = list_folder(folder);
  std::erase_if(folders, is_hidden);
  std::erase_if(files, is_hidden);

  PictureFolder listed;
  listed.folders = std::move(folders);
  Pictures pictures(natural_less);
  for (const fs::path name : files) {
    const std::size_t rank = extension_rank(name);
    if (rank == kPictureExtensions.size()) {
      const bool counts = lower_extension(name) == ".json" &&
                          listed.sidecars.try_emplace(name.stem().string(), name.string()).second;
      if (!counts) listed.left_out.push_back(name.string());
      continue;
    }
    const auto [picture, is_new] = pictures.try_emplace(name.stem().string(), name.string());
    if (is_new) continue;
    const std::size_t other_rank = extension_rank(picture->second);
    std::string other = name.string();
    // "a.png" and "a.PNG" are of one rank: the one whose name comes first counts.
    if (std::pair(rank, other) < std::pair(other_rank, picture->second)) {
      picture->second.swap(other);
    }
    listed.left_out.push_back(std::move(other));
  }
  std::ranges::sort(listed.left_out);
  // A folder in a label's place is a label that cannot be read, not one that is not there.
  std::erase_if(listed.folders, [&](const fs::path name) {
    return lower_extension(name) == ".json" && pictures.contains(name.stem().string()) &&
           listed.sidecars.try_emplace(name.stem().string(), name.string()).second;
  });
  listed.frames = number(pictures);
  return listed;
}

}  // namespace eventgan
