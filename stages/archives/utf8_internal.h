#pragma once

#include <string>
#include <string_view>

namespace eventgan {

/// Appends one code point to `text`; false, and nothing appended, if it is none (a surrogate, or
/// beyond U+10FFFF).
bool append_utf8(char32_t code_point, std::string& text);

/// Whether `text` is well-formed UTF-8: no overlong forms, no surrogates.
bool is_utf8(std::string_view text);

}  // namespace eventgan
