#include "stages/frames/sequences/image_folder.h"

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <system_error>
#include <tuple>
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

namespace {

/// An image's name about its number.
struct NumberInName {
  std::string before, after;
  std::int64_t number = 0;
  std::int64_t time_ns = -1;  ///< -1: the number is no time
};

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

std::optional<std::int64_t> parse_digits(std::string_view digits) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return error == std::errc() ? std::optional(value) : std::nullopt;
}

/// The time that a number without leading zeros is by its digits; -1 if it is none.
std::int64_t time_of_digits(std::string_view digits, std::int64_t number) {
  if (digits.front() == '0') return -1;
  switch (digits.size()) {
    case 13:
      return number * 1'000'000;
    case 15:
    case 16:
      return number * 1'000;
    case 18:
    case 19:
      return number;
    default:
      return -1;
  }
}

std::optional<NumberInName> find_number(std::string stem) {
  constexpr std::string_view kDigits = "0123456789";
  constexpr std::size_t kSecondsDigits = 9, kNanosecondsDigits = 9;
  if (const std::size_t roboflow = stem.rfind(".rf."); roboflow != std::string::npos) {
    stem.resize(roboflow);
  }
  const std::size_t last = stem.find_last_of(kDigits);
  if (last == std::string::npos) return std::nullopt;
  std::size_t end = last;  // of the number's last digit
  while (end != std::string::npos && end + 1 < stem.size() && is_letter(stem[end + 1])) {
    const std::size_t before = stem.find_last_not_of(kDigits, end);
    end = before == std::string::npos ? before : stem.find_last_of(kDigits, before);
  }
  if (end == std::string::npos) end = last;
  const auto begin_of_run = [&](std::size_t run_end) {
    const std::size_t before = stem.find_last_not_of(kDigits, run_end);
    return before == std::string::npos ? 0 : before + 1;
  };
  std::size_t begin = begin_of_run(end);
  const std::string digits = stem.substr(begin, end + 1 - begin);
  const auto number = parse_digits(digits);
  if (!number) return std::nullopt;
  NumberInName found{"", stem.substr(end + 1), *number, time_of_digits(digits, *number)};
  if (begin >= 2 && stem[begin - 1] == '.' && is_digit(stem[begin - 2])) {
    const std::size_t whole = begin_of_run(begin - 2);
    const std::string seconds = stem.substr(whole, begin - 1 - whole);
    if ((seconds.size() == kSecondsDigits || seconds.size() == kSecondsDigits + 1) &&
        seconds.front() != '0' && digits.size() <= kNanosecondsDigits) {
      const std::string zeros(kNanosecondsDigits - digits.size(), '0');
      found.time_ns = *parse_digits(seconds + digits + zeros);
      found.number = found.time_ns;
      begin = whole;
    }
  }
  found.before = stem.substr(0, begin);
  return found;
}

/// The images whose names are alike but for their number.
struct AlikeImages {
  std::vector<NumberedSequence::Frame> frames;
  std::vector<std::int64_t> times_ns;
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

/// `images` ascend by their numbers. `folder_step`: one step of two frames alone.
NamedSequence sequence_of(AlikeImages images, std::int64_t folder_step) {
  constexpr std::int64_t kMostNumber = 100'000'000'000;
  std::vector<NumberedSequence::Frame>& frames = images.frames;
  const bool is_numbered =
      std::ranges::adjacent_find(frames, {}, &NumberedSequence::Frame::first) == frames.end();
  const bool has_times =
      is_numbered && std::ranges::none_of(images.times_ns, [](auto time) { return time < 0; }) &&
      std::ranges::is_sorted(images.times_ns);
  if (!is_numbered || has_times || frames.back().first >= kMostNumber) {
    NamedSequence counted = count_frames(std::move(frames));
    for (const std::int64_t time : has_times ? images.times_ns : std::vector<std::int64_t>()) {
      counted.times_s.push_back(static_cast<double>(time - images.times_ns.front()) * 1e-9);
    }
    return counted;
  }
  NamedSequence numbered;
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

bool NamedSequence::may_have(const std::string& stem) const {
  const auto number = find_number(stem);
  return is_only || (number ? number->before == before && number->after == after : stem == before);
}

NamedSequences name_sequences(const NumberedSequence& images) {
  NamedSequences result;
  if (images.empty()) return result;
  std::vector<std::pair<NumberInName, std::string>> names;
  for (const auto& [place, name] : images.frames()) {
    const std::string stem = fs::path(name).stem().string();
    names.emplace_back(find_number(stem).value_or(NumberInName{stem, "", 0, -1}), name);
  }
  std::ranges::stable_sort(names, {}, [](const auto& one) { return one.first.number; });
  std::map<std::pair<std::string, std::string>, AlikeImages> alike;
  for (const auto& [number, name] : names) {
    AlikeImages& same = alike[{number.before, number.after}];
    same.frames.emplace_back(number.number, name);
    same.times_ns.push_back(number.time_ns);
  }
  std::size_t alone = 0;
  std::int64_t folder_step = std::numeric_limits<std::int64_t>::max();
  for (const auto& [around, same] : alike) {
    alone += same.frames.size() == 1;
    if (same.frames.size() > 1) {
      folder_step = std::min(folder_step, std::max<std::int64_t>(smallest_step(same.frames), 1));
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
