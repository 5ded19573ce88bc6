#include "stages/shards/codec/quantization.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "stages/base/processor_clones.h"
#include "stages/shards/codec/chunk_filters.h"

#if defined(__x86_64__)
#include <cpuid.h>
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

/// Converts the largest multiple of 8 halves with F16C; returns how many.
__attribute__((target("avx,f16c"))) std::size_t convert_eights(
    std::span<const std::uint16_t> halves, float* values) {
  std::size_t i = 0;
  for (; i + 8 <= halves.size(); i += 8) {
    const auto* const eight = reinterpret_cast<const __m128i*>(halves.data() + i);
    _mm256_storeu_ps(values + i, _mm256_cvtph_ps(_mm_loadu_si128(eight)));
  }
  return i;
}

/// Not by __builtin_cpu_supports alone: Clang learnt the word "f16c" late.
bool has_f16c() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __get_cpuid(1, &a, &b, &c, &d) != 0 && (c & bit_F16C) != 0;
}

const bool kHasConversion = __builtin_cpu_supports("avx") && has_f16c();
#endif

}  // namespace

std::uint16_t to_half(float value) { return rounded_half(value); }

Half half_of(float value) {
  constexpr std::uint16_t kSign = 0x8000;
  const std::uint16_t size = to_half(std::abs(value));
  return {static_cast<std::uint16_t>(value < 0 ? size | kSign : size)};
}

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

void from_halves(std::span<const std::uint16_t> halves, float* values) {
#if defined(__x86_64__)
  if (kHasConversion) {
    const std::size_t done = convert_eights(halves, values);
    halves = halves.subspan(done);
    values += done;
  }
#endif
  for (const std::uint16_t half : halves) *values++ = from_half(half);
}

namespace {

static_assert(std::endian::native == std::endian::little, "volumes are stored little endian");

/// Values taken at once: their numbers stay in the first-level cache until they are split.
constexpr std::size_t kBlock = 1024;

/// `convert(values, numbers)` makes the numbers of up to kBlock values.
template <class Number, class Convert>
void quantize_blocks(std::span<const float> values, std::byte* planes, std::size_t plane_size,
                     Convert convert) {
  std::array<Number, kBlock> numbers;
  while (!values.empty()) {
    const std::size_t count = std::min(values.size(), kBlock);
    convert(values.first(count), numbers.data());
    split_into_planes(std::span<const Number>(numbers.data(), count), planes, plane_size);
    values = values.subspan(count);
    planes += count;
  }
}

/// Division, minimum and conversion become vector instructions; there is no multiplication that a
/// compiler could contract with the addition, so every processor gives the same codes.
EVENTGAN_CLONES void quantize_uint8(std::span<const float> values, float scale, std::byte* codes) {
  const float* __restrict in = values.data();
  auto* __restrict out = reinterpret_cast<std::uint8_t*>(codes);
  for (std::size_t i = 0; i < values.size(); ++i) {
    out[i] = static_cast<std::uint8_t>(std::min(in[i] / scale + 0.5f, 255.0f));
  }
}

/// The step of uint8 codes. Never so small that it is a subnormal number itself: such a step has
/// too few bits left for 255 of them to make up the largest value.
float uint8_scale(float largest) {
  if (largest == 0) return 1;
  return std::max(largest / 255, std::numeric_limits<float>::min());
}

EVENTGAN_CLONES void dequantize_uint8(const std::byte* codes, float scale,
                                      std::span<float> values) {
  const auto* __restrict in = reinterpret_cast<const std::uint8_t*>(codes);
  float* __restrict out = values.data();
  for (std::size_t i = 0; i < values.size(); ++i) out[i] = scale * in[i];
}

}  // namespace

Quantization quantization(StoredType type, float largest) {
  Quantization result{type};
  if (type == StoredType::kUint8) result.scale = uint8_scale(largest);
  result.saturated = type == StoredType::kFloat16 && largest > kLargestHalf;
  // A larger value never gets a smaller number, so the largest tells of all.
  std::array<std::byte, sizeof(float)> number{};
  quantize({&largest, 1}, result, number.data(), 1);
  result.vanished = largest > 0 && std::ranges::all_of(
                                       number, [](std::byte byte) { return byte == std::byte{0}; });
  return result;
}

void quantize(std::span<const float> values, const Quantization& how, std::byte* planes,
              std::size_t plane_size) {
  switch (how.type) {
    case StoredType::kFloat32:
      quantize_blocks<std::uint32_t>(values, planes, plane_size,
                                     [](std::span<const float> block, std::uint32_t* numbers) {
                                       std::memcpy(numbers, block.data(), block.size_bytes());
                                     });
      break;
    case StoredType::kFloat16:
      quantize_blocks<std::uint16_t>(values, planes, plane_size, to_halves);
      break;
    case StoredType::kUint8:
      quantize_uint8(values, how.scale, planes);
      break;
  }
}

void dequantize(std::span<const std::byte> numbers, StoredType type, float scale,
                std::span<float> values) {
  if (type == StoredType::kFloat32) {
    std::memcpy(values.data(), numbers.data(), values.size_bytes());
  } else if (type == StoredType::kUint8) {
    dequantize_uint8(numbers.data(), scale, values);
  } else {
    std::array<std::uint16_t, kBlock> halves;
    for (std::size_t i = 0; i < values.size(); i += kBlock) {
      const std::span block(halves.data(), std::min(kBlock, values.size() - i));
      std::memcpy(block.data(), numbers.data() + i * sizeof(std::uint16_t), block.size_bytes());
      from_halves(block, values.data() + i);
    }
  }
}

}  // namespace eventgan
