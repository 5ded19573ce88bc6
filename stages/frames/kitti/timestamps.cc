#include "stages/frames/kitti/timestamps.h"

#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>

#include "stages/frames/kitti/text_table.h"

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

}  // namespace eventgan
