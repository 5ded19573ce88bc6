#include "stages/frames/kitti/timestamps.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>

#include "manifests/faults.h"
#include "stages/frames/kitti/text_table.h"

namespace eventgan {
namespace {

using std::chrono::nanoseconds;

/// The parts of `text` between the characters of `separators`, which must all occur in this order.
template <std::size_t N>
std::optional<std::array<int, N>> split_numbers(std::string_view text,
                                                std::string_view separators) {
  std::array<int, N> numbers{};
  for (std::size_t i = 0; i < N; ++i) {
    const std::size_t end = i + 1 < N ? text.find(separators[i]) : text.size();
    if (end == std::string_view::npos) return std::nullopt;
    const auto number = parse_number<int>(text.substr(0, end));
    if (!number || *number < 0) return std::nullopt;
    numbers[i] = *number;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return numbers;
}

/// Digits after the decimal point as nanoseconds; more than nine are cut off.
std::optional<nanoseconds> parse_fraction(std::string_view digits) {
  std::string nine(digits.substr(0, 9));
  nine.resize(9, '0');
  const auto value = parse_number<std::int64_t>(nine);
  if (!value || *value < 0) return std::nullopt;
  return nanoseconds(*value);
}

/// Since 1970, as if the clock ran on UTC; only differences are used.
std::optional<nanoseconds> parse_timestamp(std::string_view line) {
  const auto columns = split_columns(line);
  if (columns.size() != 2) return std::nullopt;
  const std::size_t point = std::min(columns[1].find('.'), columns[1].size());
  const auto date = split_numbers<3>(columns[0], "--");
  const auto clock = split_numbers<3>(columns[1].substr(0, point), "::");
  const auto fraction = parse_fraction(columns[1].substr(std::min(point + 1, columns[1].size())));
  if (!date || !clock || !fraction) return std::nullopt;

  const std::chrono::year_month_day day{std::chrono::year((*date)[0]),
                                        std::chrono::month(static_cast<unsigned>((*date)[1])),
                                        std::chrono::day(static_cast<unsigned>((*date)[2]))};
  if (!day.ok() || (*clock)[0] > 23 || (*clock)[1] > 59 || (*clock)[2] > 60) return std::nullopt;
  return std::chrono::sys_days(day).time_since_epoch() + std::chrono::hours((*clock)[0]) +
         std::chrono::minutes((*clock)[1]) + std::chrono::seconds((*clock)[2]) + *fraction;
}

}  // namespace

std::vector<double> parse_timestamps(std::string_view text, const std::string& path) {
  std::vector<double> seconds;
  std::optional<nanoseconds> first;
  for (const TextLine& line : split_lines(text)) {
    if (split_columns(line.bytes).empty()) {
      seconds.push_back(std::numeric_limits<double>::quiet_NaN());
      continue;
    }
    const auto time = parse_timestamp(line.bytes);
    if (!time) {
      throw InputError("expected a time such as 2011-09-26 13:02:25.594360375, got " +
                       in_quotes(line.bytes) + ", in " + place_in_file(path, line.number));
    }
    if (!first) first = time;
    seconds.push_back(std::chrono::duration<double>(*time - *first).count());
  }
  return seconds;
}

}  // namespace eventgan
