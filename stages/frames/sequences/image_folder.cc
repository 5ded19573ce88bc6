#include "stages/frames/sequences/image_folder.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "stages/frames/numbered_sequence.h"
#include "stages/frames/source_folders.h"

namespace eventgan {

std::string lower_extension(const std::filesystem::path& file) {
  return in_small_letters(file.extension().string());
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

/// The place of the extension in kImageExtensions; its size if it is none of them.
std::size_t extension_rank(const fs::path& name) {
  return static_cast<std::size_t>(std::ranges::find(kImageExtensions, lower_extension(name)) -
                                  kImageExtensions.begin());
}

/// A stem's last run of digits, and what is before it.
struct NumberedStem {
  std::string_view prefix;
  std::int64_t number = 0;
};

std::optional<NumberedStem> parse_stem(std::string_view stem) {
  constexpr std::size_t kMostDigits = 18;
  const std::size_t before = stem.find_last_not_of("0123456789");
  const std::size_t begin = before == std::string_view::npos ? 0 : before + 1;
  const std::string_view digits = stem.substr(begin);
  if (digits.empty() || digits.size() > kMostDigits) return std::nullopt;
  NumberedStem parsed{stem.substr(0, begin), 0};
  std::from_chars(digits.data(), digits.data() + digits.size(), parsed.number);
  return parsed;
}

/// Stem to file name, stems in natural order.
using Images = std::map<std::string, std::string, decltype(&natural_less)>;

NumberedSequence number(const Images& images) {
  std::vector<NumberedSequence::Frame> numbered, counted;
  std::set<std::int64_t> numbers;
  std::optional<std::string_view> prefix;
  bool all_numbered = true;
  for (const auto& [stem, name] : images) {
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

ImageFolder list_image_folder(const fs::path& folder) {
  const auto is_hidden = [](const std::string& name) { return name.starts_with('.'); };
  auto [folders, files, unnameable] = list_folder(folder);
  std::erase_if(folders, is_hidden);
  std::erase_if(files, is_hidden);

  ImageFolder listed;
  listed.folders = std::move(folders);
  listed.left_out = std::move(unnameable);
  Images images(natural_less);
  for (const fs::path name : files) {
    const std::size_t rank = extension_rank(name);
    if (rank == kImageExtensions.size()) {
      const bool counts = lower_extension(name) == ".json" &&
                          listed.sidecars.try_emplace(name.stem().string(), name.string()).second;
      if (!counts) listed.left_out.push_back(name.string());
      continue;
    }
    const auto [image, is_new] = images.try_emplace(name.stem().string(), name.string());
    if (is_new) continue;
    const std::size_t other_rank = extension_rank(image->second);
    std::string other = name.string();
    // "a.png" and "a.PNG" are of one rank: the one whose name comes first counts.
    if (std::pair(rank, other) < std::pair(other_rank, image->second)) {
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

}  // namespace eventgan
