#include "stages/recordings/detail/ecd_event_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <system_error>

#include "manifests/values/faults.h"

namespace eventgan {
namespace {

bool is_blank(char character) { return character == ' ' || character == '\t' || character == '\r'; }

/// Takes a number and the blanks after it off the front of `text`; false if there is none.
template <class Number>
bool take_number(const char*& begin, const char* end, Number& number) {
  const auto [stop, error] = std::from_chars(begin, end, number);
  if (error != std::errc() || (stop != end && !is_blank(*stop))) return false;
  begin = stop;
  while (begin != end && is_blank(*begin)) ++begin;
  return true;
}

/// Foreign text for a message: cut, all but printable ASCII as '?'.
[[noreturn]] void refuse(std::string_view line) {
  std::string text(line.substr(0, 40));
  for (char& character : text) {
    if (character < ' ' || character > '~') character = '?';
  }
  throw EventFault("expected an event \"t x y p\", got \"" + text + "\"");
}

}  // namespace

StoredEvent parse_ecd_event(std::string_view line) {
  const char* begin = line.data();
  const char* const end = begin + line.size();
  double t_s = 0;
  int x = 0;
  int y = 0;
  int polarity = 0;
  if (!take_number(begin, end, t_s) || !take_number(begin, end, x) || !take_number(begin, end, y) ||
      !take_number(begin, end, polarity) || begin != end) {
    refuse(line);
  }
  return {static_cast<double>(x), static_cast<double>(y), t_s, static_cast<double>(polarity)};
}

double parse_ecd_event_time(std::string_view line) {
  const char* begin = line.data();
  double t_s = 0;
  if (!take_number(begin, line.data() + line.size(), t_s) || !std::isfinite(t_s)) refuse(line);
  return t_s;
}

namespace {

constexpr std::int64_t kLongestLine = 256;
constexpr std::int64_t kUsualLine = 21;  // "0.003811000 96 133 0\n"
constexpr std::int64_t kWindow = 16 * kLongestLine;
constexpr std::int64_t kBytesPerRead = std::int64_t{1} << 20;

/// Calls `take(line, offset)` with each line of `text`, until it gives false.
template <class Take>
void for_each_line(std::string_view text, Take take) {
  std::size_t begin = 0;
  while (begin < text.size()) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    if (!take(text.substr(begin, end - begin), begin)) return;
    begin = end + 1;
  }
}

std::string long_line_text() {
  return "expected lines of up to " + std::to_string(kLongestLine) + " bytes, got a longer one";
}

[[noreturn]] void refuse_length() { throw EventFault(long_line_text()); }

}  // namespace

void EcdEventFile::refuse(const EventFault& fault, std::int64_t line_begin) const {
  std::int64_t line = 1;
  for (std::int64_t begin = 0; begin < line_begin; begin += kBytesPerRead) {
    const std::string bytes =
        file_.read_between(begin, std::min(begin + kBytesPerRead, line_begin));
    line += std::ranges::count(bytes, '\n');
  }
  throw InputError(std::string(fault.what()) + ", in " + file_.name() + " (line " +
                   std::to_string(line) + ")");
}

EcdEventFile::Line EcdEventFile::line_from(std::int64_t byte) const {
  const std::string bytes =
      file_.read_between(byte - 1, std::min(byte + 2 * kLongestLine, file_.end_byte()));
  const std::size_t before = bytes.find('\n');
  const std::size_t begin = before + 1;
  const std::size_t end = before == std::string::npos ? before : bytes.find('\n', begin);
  const std::int64_t line_begin = byte + static_cast<std::int64_t>(begin) - 1;
  try {
    if (end == std::string::npos) refuse_length();
    return {line_begin, byte + static_cast<std::int64_t>(end),
            parse_ecd_event_time(std::string_view(bytes).substr(begin, end - begin))};
  } catch (const EventFault& fault) {
    refuse(fault, before == std::string::npos ? byte : line_begin);
  }
}

std::int64_t EcdEventFile::first_byte_after(double time_s) const {
  // Lines before `low` are at or before the time, those from `high` on are after it.
  std::int64_t low = 0;
  std::int64_t high = file_.end_byte();
  while (high - low > kWindow) {
    const Line line = line_from(low + (high - low) / 2);
    (line.time_s > time_s ? high : low) = line.time_s > time_s ? line.begin : line.end;
  }
  const std::string bytes = file_.read_between(low, high);
  std::int64_t found = high;
  double previous_s = std::numeric_limits<double>::lowest();
  for_each_line(bytes, [&](std::string_view line, std::size_t offset) {
    const std::int64_t begin = low + static_cast<std::int64_t>(offset);
    try {
      const double line_s = parse_ecd_event_time(line);
      check_event_time(previous_s, line_s);
      previous_s = line_s;
      if (line_s <= time_s) return true;
    } catch (const EventFault& fault) {
      refuse(fault, begin);
    }
    found = begin;
    return false;
  });
  return found;
}

namespace {

/// What so many lines take, and more than one.
std::int64_t usual_bytes(std::int64_t lines) {
  return std::min(2 * kLongestLine + std::min(lines, kBytesPerRead) * kUsualLine, kBytesPerRead);
}

}  // namespace

std::int64_t EcdEventFile::skip_lines(std::int64_t byte, std::int64_t lines) const {
  while (lines > 0 && byte < file_.end_byte()) {
    const std::string bytes =
        file_.read_between(byte, std::min(byte + usual_bytes(lines), file_.end_byte()));
    std::size_t at = 0;
    for (; lines > 0 && at < bytes.size(); --lines) {
      at = std::min(bytes.find('\n', at), bytes.size() - 1) + 1;
      if (bytes[at - 1] != '\n') break;  // the line goes on behind what was read
    }
    byte += static_cast<std::int64_t>(at);
  }
  while (lines < 0 && byte > 0) {
    const std::int64_t begin = std::max<std::int64_t>(byte - usual_bytes(-lines), 0);
    const std::string bytes = file_.read_between(begin, byte);
    // The line before starts behind the last line end but the one that ends it.
    std::size_t at = bytes.size();
    for (; lines < 0 && at > 0; ++lines) {
      const std::size_t end = at >= 2 ? bytes.rfind('\n', at - 2) : std::string::npos;
      if (end == std::string::npos && begin > 0) break;  // it starts before what was read
      at = end == std::string::npos ? 0 : end + 1;
    }
    if (at == bytes.size()) refuse(EventFault(long_line_text()), begin);
    byte = begin + static_cast<std::int64_t>(at);
  }
  return byte;
}

std::optional<std::array<double, 2>> EcdEventFile::span() const {
  const std::int64_t end = file_.end_byte();
  if (end == 0) return std::nullopt;
  const auto time_at = [&](std::int64_t byte) {
    const std::string bytes = file_.read_between(byte, std::min(byte + kLongestLine, end));
    try {
      return parse_ecd_event_time(std::string_view(bytes).substr(0, bytes.find('\n')));
    } catch (const EventFault& fault) {
      refuse(fault, byte);
    }
  };
  return std::array{time_at(0), time_at(skip_lines(end, -1))};
}

std::vector<Event> EcdEventFile::events(std::int64_t begin, std::int64_t end,
                                        EventCheck check) const {
  if (end < begin) refuse(EventFault("expected times that never decrease, got others"), end);
  std::vector<Event> events;
  events.reserve(static_cast<std::size_t>((end - begin) / kUsualLine));
  while (begin < end) {
    std::string bytes = file_.read_between(begin, std::min(begin + kBytesPerRead, end));
    const bool whole = begin + static_cast<std::int64_t>(bytes.size()) == end;
    if (!whole) bytes.resize(bytes.rfind('\n') + 1);  // none: nothing, and npos + 1 is 0
    std::size_t at = 0;
    try {
      if (bytes.empty()) refuse_length();
      for_each_line(bytes, [&](std::string_view line, std::size_t offset) {
        at = offset;
        events.push_back(check.take(parse_ecd_event(line)));
        return true;
      });
    } catch (const EventFault& fault) {
      refuse(fault, begin + static_cast<std::int64_t>(at));
    }
    begin += static_cast<std::int64_t>(bytes.size());
  }
  return events;
}

}  // namespace eventgan
