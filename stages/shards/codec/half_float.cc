#include "stages/shards/codec/half_float.h"

#include <algorithm>
#include <bit>
#include <cstddef>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace eventgan {
namespace {

// A float has 23 bits of mantissa and exponent bias 127; a half 10 and 15.
constexpr int kDroppedBits = 23 - 10;
constexpr std::uint32_t kBiasDifference = 127 - 15;

/// to_half without branches, so that a loop over it becomes vector instructions.
inline std::uint16_t rounded_half(float value) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(value) & 0x7fffffff;
  // Below 2^-14 halves are multiples of 2^-24. In [0.5, 1) floats are too, so adding 0.5 makes the
  // processor round to them, ties to even.
  const float shifted = std::bit_cast<float>(bits) + 0.5f;
  const std::uint32_t subnormal =
      std::bit_cast<std::uint32_t>(shifted) - std::bit_cast<std::uint32_t>(0.5f);
  // Half a step is added, less one unit where the kept mantissa is even: ties then stay below. A
  // carry out of the mantissa goes into the exponent, as it must.
  const std::uint32_t odd = (bits >> kDroppedBits) & 1;
  const std::uint32_t rounded =
      bits + ((1u << (kDroppedBits - 1)) - 1) + odd - (kBiasDifference << 23);
  const bool small = bits < (kBiasDifference + 1) << 23;
  return static_cast<std::uint16_t>(small ? subnormal : rounded >> kDroppedBits);
}

#if defined(__x86_64__)
/// Converts the largest multiple of 8 values with F16C; returns how many.
__attribute__((target("avx,f16c"))) std::size_t convert_eights(std::span<const float> values,
                                                               std::uint16_t* halves) {
  const __m256 largest = _mm256_set1_ps(kLargestHalf);
  const __m128i magnitude = _mm_set1_epi16(0x7fff);  // to_half drops the sign of -0 too
  std::size_t i = 0;
  for (; i + 8 <= values.size(); i += 8) {
    const __m256 eight = _mm256_min_ps(_mm256_loadu_ps(values.data() + i), largest);
    const __m128i rounded = _mm256_cvtps_ph(eight, _MM_FROUND_TO_NEAREST_INT);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(halves + i), _mm_and_si128(rounded, magnitude));
  }
  return i;
}

const bool kHasConversion = __builtin_cpu_supports("avx") && __builtin_cpu_supports("f16c");
#endif

}  // namespace

std::uint16_t to_half(float value) { return rounded_half(value); }

void to_halves(std::span<const float> values, std::uint16_t* halves) {
#if defined(__x86_64__)
  if (kHasConversion) {
    const std::size_t done = convert_eights(values, halves);
    values = values.subspan(done);
    halves += done;
  }
#endif
  for (const float value : values) *halves++ = rounded_half(std::min(value, kLargestHalf));
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
