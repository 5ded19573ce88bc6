#pragma once

#include <cstdint>

namespace eventgan {

/// A number as float16 (IEEE 754 binary16) stores it; stages/shards/codec/quantization.h has its
/// value.
struct Half {
  std::uint16_t bits = 0;
  bool operator==(const Half&) const = default;
};

inline constexpr Half kHalfNan{0x7e00};

constexpr bool is_nan(Half half) { return (half.bits & 0x7fff) > 0x7c00; }

}  // namespace eventgan
