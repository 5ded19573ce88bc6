#include "stages/shards/codec/quantization.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "stages/shards/codec/byte_planes.h"
#include "stages/shards/codec/half_float.h"

namespace eventgan {
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
void quantize_uint8(std::span<const float> values, float scale, std::byte* codes) {
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

template <class Code, class Decode>
std::vector<float> decode_each(std::span<const std::byte> bytes, Decode decode) {
  std::vector<float> values(bytes.size() / sizeof(Code));
  const std::byte* in = bytes.data();
  for (float& value : values) {
    Code code;
    std::memcpy(&code, in, sizeof(Code));
    value = decode(code);
    in += sizeof(Code);
  }
  return values;
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

std::vector<float> dequantize(std::span<const std::byte> bytes, StoredType type, float scale) {
  switch (type) {
    case StoredType::kFloat32:
      return decode_each<float>(bytes, [](float value) { return value; });
    case StoredType::kFloat16:
      return decode_each<std::uint16_t>(bytes, from_half);
    case StoredType::kUint8:
      return decode_each<std::uint8_t>(bytes, [scale](std::uint8_t code) { return scale * code; });
  }
  throw std::logic_error("unknown stored type");
}

}  // namespace eventgan
