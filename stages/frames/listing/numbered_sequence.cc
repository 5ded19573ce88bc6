#include "stages/frames/listing/numbered_sequence.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <limits>
#include <map>
#include <optional>

#include "manifests/values/faults.h"
#include "stages/frames/listing/source_folders.h"

namespace eventgan {
namespace {

constexpr std::size_t kMaxDigits = 18;

bool ends_with_ignoring_case(std::string_view name, std::string_view lower_case_end) {
  return name.size() >= lower_case_end.size() &&
         std::equal(
             lower_case_end.begin(), lower_case_end.end(),
             name.end() - static_cast<std::ptrdiff_t>(lower_case_end.size()),
             [](char a, char b) { return a == std::tolower(static_cast<unsigned char>(b)); });
}

/// The number in `name` and the place of its extension in `extensions`.
struct ParsedName {
  std::int64_t number = 0;
  std::size_t extension = 0;
};

std::optional<ParsedName> parse_name(std::string_view name, std::string_view prefix,
                                     const std::vector<std::string_view>& extensions) {
  if (!name.starts_with(prefix)) return std::nullopt;
  name.remove_prefix(prefix.size());
  for (std::size_t i = 0; i < extensions.size(); ++i) {
    if (!ends_with_ignoring_case(name, extensions[i])) continue;
    const std::string_view digits = name.substr(0, name.size() - extensions[i].size());
    if (digits.empty() || digits.size() > kMaxDigits || !std::ranges::all_of(digits, is_digit))
      continue;
    ParsedName parsed{0, i};
    std::from_chars(digits.data(), digits.data() + digits.size(), parsed.number);
    return parsed;
  }
  return std::nullopt;
}

bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

std::optional<std::int64_t> parse_digits(std::string_view digits) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return error == std::errc() ? std::optional(value) : std::nullopt;
}

/// The time that a number without leading zeros is by its digits; -1 if it is none.
std::int64_t time_of_digits(std::string_view digits, std::int64_t number) {
  if (digits.front() == '0') return -1;
  const auto in_units_of = [&](std::int64_t unit_ns) {
    return number <= std::numeric_limits<std::int64_t>::max() / unit_ns ? number * unit_ns : -1;
  };
  switch (digits.size()) {
    case 13:
      return in_units_of(1'000'000);
    case 15:
    case 16:
      return in_units_of(1'000);
    case 18:
    case 19:
      return number;
    default:
      return -1;
  }
}

}  // namespace

NumberInName find_number(std::string_view stem) {
  constexpr std::string_view kDigits = "0123456789";
  constexpr std::size_t kSecondsDigits = 9, kNanosecondsDigits = 9;
  NumberInName found;
  found.before = stem;
  stem = stem.substr(0, stem.rfind(".rf."));
  const std::size_t last = stem.find_last_of(kDigits);
  if (last == std::string_view::npos) return found;
  std::size_t end = last;  // of the number's last digit
  while (end != std::string_view::npos && end + 1 < stem.size() && is_letter(stem[end + 1])) {
    const std::size_t before = stem.find_last_not_of(kDigits, end);
    end = before == std::string_view::npos ? before : stem.find_last_of(kDigits, before);
  }
  if (end == std::string_view::npos) end = last;
  const auto begin_of_run = [&](std::size_t run_end) {
    const std::size_t before = stem.find_last_not_of(kDigits, run_end);
    return before == std::string_view::npos ? 0 : before + 1;
  };
  std::size_t begin = begin_of_run(end);
  const std::string digits(stem.substr(begin, end + 1 - begin));
  const auto number = parse_digits(digits);
  if (!number) return found;
  found.number = *number;
  found.time_ns = time_of_digits(digits, *number);
  if (begin >= 2 && stem[begin - 1] == '.' && is_digit(stem[begin - 2])) {
    const std::size_t whole = begin_of_run(begin - 2);
    const std::string seconds(stem.substr(whole, begin - 1 - whole));
    if ((seconds.size() == kSecondsDigits || seconds.size() == kSecondsDigits + 1) &&
        seconds.front() != '0' && digits.size() <= kNanosecondsDigits) {
      const std::string zeros(kNanosecondsDigits - digits.size(), '0');
      if (const auto time_ns = parse_digits(seconds + digits + zeros)) {
        found.time_ns = found.number = *time_ns;
        begin = whole;
      }
    }
  }
  found.before = stem.substr(0, begin);
  found.digits = stem.substr(begin, end + 1 - begin);
  found.after = stem.substr(end + 1);
  return found;
}

std::string renumbered(const std::string& name, std::int64_t number) {
  const std::filesystem::path path(name);
  const NumberInName old = find_number(path.stem().string());
  return fmt::format("{}{:0{}}{}{}", old.before, number, old.digits.size(), old.after,
                     path.extension().string());
}

NumberedSequence::NumberedSequence(std::vector<Frame> frames, Stride stride)
    : frames_(std::move(frames)) {
  std::ranges::sort(frames_);
  if (stride == Stride::kOne) return;
  for (std::size_t i = 1; i < frames_.size(); ++i) {
    const std::int64_t step = frames_[i].first - frames_[i - 1].first;
    stride_ = i == 1 ? step : std::min(stride_, step);
  }
}

NumberedSequence::NumberedSequence(std::vector<Frame> frames, std::int64_t stride)
    : NumberedSequence(std::move(frames)) {
  stride_ = stride;
}

NumberedSequence NumberedSequence::list(const std::filesystem::path& folder,
                                        std::string_view prefix,
                                        const std::vector<std::string_view>& extensions,
                                        Stride stride) {
  struct Listed {
    std::size_t extension;
    std::string name;
  };
  std::map<std::int64_t, Listed> found;
  auto [folders, names, left_out] = list_folder(folder);
  // A folder named as a frame is one that cannot be read, not one that is not there.
  std::erase_if(folders, [&](const auto& name) { return !parse_name(name, prefix, extensions); });
  names.insert(names.end(), folders.begin(), folders.end());
  for (std::string& name : names) {
    const auto parsed = parse_name(name, prefix, extensions);
    if (!parsed) {
      if (!name.starts_with('.')) left_out.push_back(std::move(name));
      continue;
    }
    const auto place = found.find(parsed->number);
    if (place == found.end()) {
      found.emplace(parsed->number, Listed{parsed->extension, std::move(name)});
      continue;
    }
    Listed& other = place->second;
    if (parsed->extension == other.extension) {
      throw InputError("expected one file for each frame number, got " + other.name + " and " +
                       name + ", in " + folder.string());
    }
    Listed listed{parsed->extension, std::move(name)};
    if (listed.extension < other.extension) std::swap(listed, other);
    left_out.push_back(std::move(listed.name));
  }
  std::ranges::sort(left_out);

  std::vector<Frame> frames;
  frames.reserve(found.size());
  for (auto& [number, listed] : found) frames.emplace_back(number, std::move(listed.name));
  NumberedSequence sequence(std::move(frames), stride);
  sequence.left_out_ = std::move(left_out);
  return sequence;
}

std::vector<NumberedSequence::Frame>::const_iterator NumberedSequence::lower_bound(
    std::int64_t number) const {
  return std::ranges::lower_bound(frames_, number, {}, &Frame::first);
}

bool NumberedSequence::contains(std::int64_t number) const {
  const auto frame = lower_bound(number);
  return frame != frames_.end() && frame->first == number;
}

NumberedSequence::Place NumberedSequence::find(std::int64_t number) const {
  const auto frame = lower_bound(number);
  if (frame != frames_.end() && frame->first == number) {
    return {PairedFrame::State::kPresent, number, frame->second};
  }
  const bool goes_on = frame != frames_.begin() && frame != frames_.end();
  return {goes_on ? PairedFrame::State::kMissing : PairedFrame::State::kBeyond, number,
          name_for(number)};
}

NumberedSequence::Place NumberedSequence::at(std::int64_t number, int steps) const {
  Place place = find(number + steps * stride_);
  if (place.state == PairedFrame::State::kPresent) return place;
  const bool goes_on =
      steps == 0 || (!empty() && (steps > 0 ? frames_.back().first > place.number
                                            : frames_.front().first < place.number));
  place.state = goes_on ? PairedFrame::State::kMissing : PairedFrame::State::kBeyond;
  return place;
}

std::string NumberedSequence::name_for(std::int64_t number) const {
  if (frames_.empty() || number < 0) return {};
  return renumbered(frames_.front().second, number);
}

}  // namespace eventgan
