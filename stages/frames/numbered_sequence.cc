#include "stages/frames/numbered_sequence.h"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <map>
#include <optional>

#include "manifests/values/faults.h"
#include "stages/frames/source_folders.h"

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

}  // namespace

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
  // The first frame's name with its digits replaced: the last run of them before the extension.
  const std::string& like = frames_.front().second;
  std::size_t end = like.rfind('.');
  if (end == std::string::npos) end = like.size();
  std::size_t begin = end;
  while (begin > 0 && is_digit(like[begin - 1])) --begin;
  return fmt::format("{}{:0{}}{}", like.substr(0, begin), number, end - begin, like.substr(end));
}

}  // namespace eventgan
