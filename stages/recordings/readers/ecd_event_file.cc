#include "stages/recordings/readers/detail/ecd_event_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <system_error>

#include "manifests/values/faults.h"
#include "stages/recordings/order/event_index.h"

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
[[noreturn]] void refuse_line(std::string_view line) {
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
    refuse_line(line);
  }
  return {static_cast<double>(x), static_cast<double>(y), t_s, static_cast<double>(polarity)};
}

namespace {

/// None of a line that does not begin with a finite time.
std::optional<double> time_of(std::string_view line) {
  const char* begin = line.data();
  double t_s = 0;
  if (!take_number(begin, line.data() + line.size(), t_s) || !std::isfinite(t_s)) {
    return std::nullopt;
  }
  return t_s;
}

constexpr std::int64_t kLongestLine = 256;
constexpr std::int64_t kUsualLine = 21;                         // "0.003811000 96 133 0\n"
constexpr std::int64_t kBytesPerBlock = std::int64_t{1} << 16;  // what a search for a time reads
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

EcdEventFile::EcdEventFile(const std::filesystem::path& path)
    : index_key_(event_index_key(path, "t x y p")), file_(path) {
  constexpr std::int64_t kMostComments = std::int64_t{1} << 16;
  const std::string text = file_.read_between(0, std::min(kMostComments, file_.end_byte()));
  for_each_line(text, [&](std::string_view line, std::size_t offset) {
    begin_ = static_cast<std::int64_t>(offset);
    const bool is_comment = line.starts_with('#');
    if (is_comment) begin_ += std::min(std::ssize(line) + 1, std::ssize(text) - begin_);
    return is_comment;
  });
}

const TimeOrder& EcdEventFile::order() const {
  std::call_once(order_once_, [&] {
    order_ = known_order(index_key_, file_.end_byte(), [&] { return look_at_times(); });
  });
  return order_;
}

TimeOrder EcdEventFile::look_at_times() const {
  TimeOrder order;
  std::int64_t block = begin_;
  for (std::int64_t begin = begin_; begin < file_.end_byte();) {
    const std::int64_t end = std::min(begin + kBytesPerRead, file_.end_byte());
    try {
      std::string bytes = file_.read_between(begin, end);
      if (end < file_.end_byte()) bytes.resize(bytes.rfind('\n') + 1);  // none: nothing
      if (bytes.empty()) refuse(EventFault(long_line_text()), begin);
      for_each_line(bytes, [&](std::string_view line, std::size_t offset) {
        const std::int64_t byte = begin + static_cast<std::int64_t>(offset);
        if (byte - block > kBytesPerBlock) order.end_block(block = byte);
        if (const auto time_s = time_of(line)) order.add(*time_s, byte);
        return true;
      });
      begin += static_cast<std::int64_t>(bytes.size());
    } catch (const InputError&) {
      order.add_unreadable(std::current_exception());
      begin = end;
    }
    order.end_block(begin);
  }
  return order;
}

std::int64_t EcdEventFile::first_byte_after(double time_s) const {
  const auto block = order().block_after(time_s);
  const std::int64_t begin = block.begin, end = block.end;
  const std::string bytes = file_.read_between(begin, end);
  std::int64_t found = end;
  for_each_line(bytes, [&](std::string_view line, std::size_t offset) {
    const auto line_s = time_of(line);
    const bool is_later = line_s && *line_s > time_s;
    if (is_later) found = begin + static_cast<std::int64_t>(offset);
    return !is_later;
  });
  return found;
}

void EcdEventFile::require_order(double after_s, double until_s) const {
  eventgan::require_order(
      order(), after_s, until_s,
      [&](const EventFault& fault, std::int64_t line_begin) { refuse(fault, line_begin); });
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
  while (lines < 0 && byte > begin_) {
    const std::int64_t begin = std::max<std::int64_t>(byte - usual_bytes(-lines), begin_);
    const std::string bytes = file_.read_between(begin, byte);
    // The line before starts behind the last line end but the one that ends it.
    std::size_t at = bytes.size();
    for (; lines < 0 && at > 0; ++lines) {
      const std::size_t end = at >= 2 ? bytes.rfind('\n', at - 2) : std::string::npos;
      if (end == std::string::npos && begin > begin_) break;  // it starts before what was read
      at = end == std::string::npos ? 0 : end + 1;
    }
    if (at == bytes.size()) refuse(EventFault(long_line_text()), begin);
    byte = begin + static_cast<std::int64_t>(at);
  }
  return byte;
}

double EcdEventFile::time_at(std::int64_t byte) const {
  const std::string bytes =
      file_.read_between(byte, std::min(byte + kLongestLine, file_.end_byte()));
  const std::string_view line = std::string_view(bytes).substr(0, bytes.find('\n'));
  if (const auto time_s = time_of(line)) return *time_s;
  try {
    refuse_line(line);
  } catch (const EventFault& fault) {
    refuse(fault, byte);
  }
}

std::optional<std::array<double, 2>> EcdEventFile::span() const {
  if (begin_ == file_.end_byte()) return std::nullopt;
  time_at(begin_);
  time_at(skip_lines(file_.end_byte(), -1));
  return order().span();
}

std::vector<Event> EcdEventFile::events(std::int64_t begin, std::int64_t end,
                                        EventCheck check) const {
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
