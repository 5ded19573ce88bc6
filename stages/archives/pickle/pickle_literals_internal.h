#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace eventgan {

// The literals of protocol 0, which writes values as Python source text. None if malformed.

/// Decimal, 64 bits; one trailing "L" is allowed.
std::optional<std::int64_t> parse_pickle_integer(std::string_view text);

/// As Python's repr writes a float, "nan" and "inf" included.
std::optional<double> parse_pickle_float(std::string_view text);

/// A quoted string of Python 2 with its escapes; gives its bytes.
std::optional<std::string> parse_pickle_string(std::string_view text);

/// Python's raw-unicode-escape: Latin-1 with \uXXXX and \UXXXXXXXX; gives UTF-8.
std::optional<std::string> parse_pickle_unicode(std::string_view text);

}  // namespace eventgan
