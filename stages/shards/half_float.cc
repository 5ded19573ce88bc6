#include "stages/shards/half_float.h"

#include <bit>

namespace eventgan {
namespace {

// A float has 23 bits of mantissa and exponent bias 127; a half 10 and 15.
constexpr int kDroppedBits = 23 - 10;
constexpr std::uint32_t kBiasDifference = 127 - 15;

}  // namespace

std::uint16_t to_half(float value) {
  std::uint32_t bits = std::bit_cast<std::uint32_t>(value) & 0x7fffffff;
  if (bits < (kBiasDifference + 1) << 23) {
    // Below 2^-14 halves are multiples of 2^-24. In [0.5, 1) floats are too, so adding 0.5 makes
    // the processor round to them, ties to even.
    const float shifted = std::bit_cast<float>(bits) + 0.5f;
    return static_cast<std::uint16_t>(std::bit_cast<std::uint32_t>(shifted) -
                                      std::bit_cast<std::uint32_t>(0.5f));
  }
  // Half a step is added, less one unit where the kept mantissa is even: ties then stay below. A
  // carry out of the mantissa goes into the exponent, as it must.
  const std::uint32_t odd = (bits >> kDroppedBits) & 1;
  bits += (1u << (kDroppedBits - 1)) - 1 + odd;
  bits -= kBiasDifference << 23;
  return static_cast<std::uint16_t>(bits >> kDroppedBits);
}

float from_half(std::uint16_t half) {
  const std::uint32_t sign = static_cast<std::uint32_t>(half & 0x8000) << 16;
  const std::uint32_t magnitude = half & 0x7fff;
  std::uint32_t bits;
  if (magnitude >= 0x7c00) {  // infinity, NaN
    bits = 0x7f800000 | (magnitude & 0x3ff) << kDroppedBits;
  } else if (magnitude >= 0x400) {
    bits = (magnitude << kDroppedBits) + (kBiasDifference << 23);
  } else {  // subnormal: a multiple of 2^-24
    bits = std::bit_cast<std::uint32_t>(static_cast<float>(magnitude) * 0x1p-24f);
  }
  return std::bit_cast<float>(bits | sign);
}

}  // namespace eventgan
