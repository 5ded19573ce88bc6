#include <charconv>
#include <cmath>
#include <string>
#include <system_error>

#include "stages/recordings/ecd_event_line_internal.h"

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

}  // namespace eventgan
