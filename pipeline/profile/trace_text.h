#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace eventgan {

/// Pieces of trace files. All thread safe.

/// The text as a JSON string with its quotes; bytes that are not UTF-8 become U+FFFD.
std::string trace_string(std::string_view text);

/// Nanoseconds ≥ 0 as microseconds, which the format counts in, without loss: 1234567 → "1234.567".
/// Rounded ones could make the end of a span overlap the end of the one around it.
std::string trace_microseconds(std::int64_t nanoseconds);

}  // namespace eventgan
