#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

namespace eventgan {

// How texts of lines, columns and numbers are read. Thread safe.

/// One line of a text and its number, counted from 1.
struct TextLine {
  std::string_view bytes;  ///< with its line end, if it has one
  int number = 0;
};

/// The lines of `text`, which concatenated are `text` again, but for a byte order mark before it
/// (Windows' editors write one into UTF-8). Views into `text`.
std::vector<TextLine> split_lines(std::string_view text);

/// The columns of a line between spaces, tabs and line ends (LF or CRLF). Views into `line`.
std::vector<std::string_view> split_columns(std::string_view line);

/// The whole token as a finite number, or nothing. What is too small for the type becomes 0.
template <class Number>
std::optional<Number> parse_number(std::string_view token) {
  Number number{};
  const char* end = token.data() + token.size();
  const auto [stop, error] = std::from_chars(token.data(), end, number);
  if (stop != end) return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>) {
    // from_chars does not tell too small from too large.
    if (error == std::errc::result_out_of_range) {
      number = static_cast<Number>(std::strtod(std::string(token).c_str(), nullptr));
    } else if (error != std::errc()) {
      return std::nullopt;
    }
    if (!std::isfinite(number)) return std::nullopt;
  } else if (error != std::errc()) {
    return std::nullopt;
  }
  return number;
}

/// The number as a whole one, or nothing: beyond 2^53 a double is not exact.
std::optional<std::int64_t> whole_of(double number);

/// The whole token as a whole number, also where a tool has written it as "2.0" (as NumPy and
/// pandas do), or nothing.
std::optional<std::int64_t> parse_whole(std::string_view token);

/// Foreign text for a message: in quotes, cut to 40 characters, all but printable ASCII as '?'.
std::string in_quotes(std::string_view text);

/// A path as a word of a command line that a message prints: in single quotes where a shell would
/// take its blanks or marks for something else.
std::string shell_word(std::string_view path);

/// "PATH:LINE".
std::string place_in_file(const std::string& path, int line);

}  // namespace eventgan
