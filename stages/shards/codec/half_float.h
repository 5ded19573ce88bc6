#pragma once

#include <cstdint>
#include <span>

namespace eventgan {

/// Largest finite IEEE 754 half.
inline constexpr float kLargestHalf = 65504;

/// The IEEE 754 half (binary16) nearest to `value`, ties to even, also among subnormals. `value`
/// must be in [0, 65504]. The same on every machine, whatever its instructions.
std::uint16_t to_half(float value);

/// halves[i] = to_half(min(values[i], 65504)) for finite values >= 0, with the processor's own
/// conversion where it has one. The same bits everywhere.
void to_halves(std::span<const float> values, std::uint16_t* halves);

/// Exact value of a half; infinities and NaN too.
float from_half(std::uint16_t half);

}  // namespace eventgan
