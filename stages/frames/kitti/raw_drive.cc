#include "stages/frames/kitti/raw_drive.h"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>

#include "manifests/values/faults.h"
#include "manifests/values/text_lines.h"

namespace eventgan {
namespace {

using std::chrono::nanoseconds;

/// The number that the digits from `begin` on are; nothing if one of them is none.
std::optional<std::int64_t> digits(std::string_view text, std::size_t begin, std::size_t count) {
  const std::string_view part = text.substr(begin, count);
  if (part.find_first_not_of("0123456789") != std::string_view::npos) return std::nullopt;
  return parse_number<std::int64_t>(part);
}

/// Digits after the decimal point as nanoseconds; more than nine are cut off.
std::optional<nanoseconds> parse_fraction(std::string_view fraction) {
  if (fraction.empty()) return std::nullopt;
  std::string nine(fraction.substr(0, 9));
  nine.resize(9, '0');
  const auto value = digits(nine, 0, nine.size());
  return value ? std::optional(nanoseconds(*value)) : std::nullopt;
}

/// "2011-09-26 13:02:25.594360375", every number with all its digits, since 1970, as if the clock
/// ran on UTC; only differences are used.
std::optional<nanoseconds> parse_timestamp(std::string_view line) {
  const auto columns = split_columns(line);
  if (columns.size() != 2) return std::nullopt;
  const std::string_view date = columns[0];
  const std::string_view clock = columns[1];
  if (date.size() != 10 || date[4] != '-' || date[7] != '-' || clock.size() < 8 ||
      clock[2] != ':' || clock[5] != ':' || (clock.size() > 8 && clock[8] != '.')) {
    return std::nullopt;
  }
  const auto year = digits(date, 0, 4), month = digits(date, 5, 2), day = digits(date, 8, 2);
  const auto hour = digits(clock, 0, 2), minute = digits(clock, 3, 2), second = digits(clock, 6, 2);
  const auto fraction = clock.size() == 8 ? nanoseconds(0) : parse_fraction(clock.substr(9));
  if (!year || !month || !day || !hour || !minute || !second || !fraction) return std::nullopt;

  const std::chrono::year_month_day when{std::chrono::year(static_cast<int>(*year)),
                                         std::chrono::month(static_cast<unsigned>(*month)),
                                         std::chrono::day(static_cast<unsigned>(*day))};
  if (!when.ok() || *hour > 23 || *minute > 59 || *second > 60) return std::nullopt;
  return std::chrono::sys_days(when).time_since_epoch() + std::chrono::hours(*hour) +
         std::chrono::minutes(*minute) + std::chrono::seconds(*second) + *fraction;
}

std::string_view without_end(std::string_view line) {
  return line.substr(0, line.find_last_not_of(" \t\r\n") + 1);
}

}  // namespace

FrameOrigin kitti_origin(const std::string& drive) { return {.drive = drive}; }

bool is_kitti_date(const std::string& folder) {
  constexpr std::size_t kLength = std::string_view("2011_09_26").size();
  return folder.size() == kLength && folder[4] == '_' && folder[7] == '_' &&
         folder.find_first_not_of("0123456789_") == std::string::npos;
}

Outcome<std::vector<double>> parse_timestamps(std::string_view text, const std::string& path) {
  std::vector<double> seconds;
  std::optional<nanoseconds> first, latest;
  std::string_view first_line, latest_line;
  for (const TextLine& line : split_lines(text)) {
    const std::string_view stamp = without_end(line.bytes);
    if (stamp.empty()) {
      seconds.push_back(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    const auto refuse = [&](const std::string& expected) {
      return SampleFault{"expected " + expected + ", got " + in_quotes(stamp) + ", in " +
                         place_in_file(path, line.number)};
    };
    const auto time = parse_timestamp(stamp);
    if (!time) return refuse("a time such as 2011-09-26 13:02:25.594360375");
    if (!first) {
      first = time;
      first_line = stamp;
    }
    if (!line.bytes.ends_with('\n') && stamp.size() < first_line.size()) {
      return refuse("a whole line");
    }
    if (latest && *time <= *latest) return refuse("a time after " + in_quotes(latest_line));
    latest = time;
    latest_line = stamp;
    seconds.push_back(std::chrono::duration<double>(*time - *first).count());
  }
  return seconds;
}

RawDrive::RawDrive(const SourceRoot& root, const std::string& folder)
    : images_path_(root.written(folder + "/image_02/data")),
      images_(NumberedSequence::list(root.on_disk(folder + "/image_02/data"))) {
  const std::string timestamps = folder + "/image_02/timestamps.txt";
  if (images_.empty() || !root.has_file(timestamps)) return;
  timestamps_path_ = root.written(timestamps);
  const auto text = root.read(timestamps);
  Outcome<std::vector<double>> times =
      is_fault(text) ? text.fault() : parse_timestamps(*text, timestamps_path_);
  if (is_fault(times)) {
    fault_ = times.fault().reason;
    return;
  }
  times_s_ = *std::move(times);
  const std::int64_t last = images_.frames().back().first;
  if (last < std::ssize(times_s_)) return;
  fault_ = "expected a line for each frame up to " + std::to_string(last) + ", got " +
           std::to_string(times_s_.size()) + " lines, in " + timestamps_path_;
  times_s_.clear();
}

PairedFrame RawDrive::frame(std::int64_t number) const { return at(images_.find(number)); }

PairedFrame RawDrive::paired_frame(std::int64_t number, int steps) const {
  return at(images_.at(number, steps));
}

PairedFrame RawDrive::at(const NumberedSequence::Place& place) const {
  if (place.number < 0) return {};
  return {place.state, {images_path_ + "/" + place.name, place.number, -1, time_s(place.number)}};
}

double RawDrive::time_s(std::int64_t number) const {
  if (timestamps_path_.empty()) return static_cast<double>(number) * kKittiFrameSeconds;
  const auto line = static_cast<std::size_t>(number);
  return number >= 0 && line < times_s_.size() ? times_s_[line]
                                               : std::numeric_limits<double>::quiet_NaN();
}

namespace {

std::vector<RawFrame> parse_lines(std::string_view text, const std::string& path) {
  std::vector<RawFrame> frames;
  for (const TextLine& line : split_lines(text)) {
    const auto columns = split_columns(line.bytes);
    const auto number = columns.size() == 3 ? parse_number<std::int64_t>(columns[2]) : std::nullopt;
    if (!number || *number < 0) {
      throw InputError("expected DATE DRIVE FRAME, got " + in_quotes(line.bytes) + ", in " +
                       place_in_file(path, line.number));
    }
    frames.push_back({std::string(columns[0]), std::string(columns[1]), *number});
  }
  return frames;
}

}  // namespace

RawMapping::RawMapping(std::string_view rand, const std::string& rand_path,
                       std::string_view mapping, const std::string& mapping_path) {
  const std::vector<RawFrame> lines = parse_lines(mapping, mapping_path);
  std::string numbers(rand);
  std::ranges::replace(numbers, ',', ' ');
  for (const std::string_view token : split_columns(numbers)) {
    const auto line = parse_number<std::int64_t>(token);
    if (!line || *line < 1 || *line > static_cast<std::int64_t>(lines.size())) {
      throw InputError("expected line numbers from 1 to " + std::to_string(lines.size()) +
                       ", got " + in_quotes(token) + ", in " + rand_path);
    }
    frames_.push_back(lines[static_cast<std::size_t>(*line - 1)]);
  }
}

std::optional<RawFrame> RawMapping::find(std::int64_t object_number) const {
  if (object_number < 0 || object_number >= static_cast<std::int64_t>(frames_.size())) {
    return std::nullopt;
  }
  return frames_[static_cast<std::size_t>(object_number)];
}

}  // namespace eventgan
