#pragma once

#include <cstdint>

namespace eventgan {

/// Largest finite IEEE 754 half.
inline constexpr float kLargestHalf = 65504;

/// The IEEE 754 half (binary16) nearest to `value`, ties to even, also among subnormals. `value`
/// must be in [0, 65504]. The same on every machine, whatever its instructions.
std::uint16_t to_half(float value);

/// Exact value of a half; infinities and NaN too.
float from_half(std::uint16_t half);

}  // namespace eventgan
