#include "stages/shards/quantization.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>

#include "stages/shards/half_float.h"

namespace eventgan {
namespace {

static_assert(std::endian::native == std::endian::little, "volumes are stored little endian");

float largest_sound_value(std::span<const float> values) {
  float largest = 0;
  bool sound = true;
  for (const float value : values) {
    sound &= value >= 0;  // false for NaN
    largest = std::max(largest, value);
  }
  if (!sound || !std::isfinite(largest)) {
    throw std::invalid_argument("expected finite values >= 0 in a volume to store, got others");
  }
  return largest;
}

template <class Code, class Encode>
std::vector<std::byte> encode_each(std::span<const float> values, Encode encode) {
  std::vector<std::byte> bytes(values.size() * sizeof(Code));
  std::byte* out = bytes.data();
  for (const float value : values) {
    const Code code = encode(value);
    std::memcpy(out, &code, sizeof(Code));
    out += sizeof(Code);
  }
  return bytes;
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

/// The step of uint8 codes. Never so small that it is a subnormal number itself: such a step has
/// too few bits left for 255 of them to make up the largest value.
float uint8_scale(float largest) {
  if (largest == 0) return 1;
  return std::max(largest / 255, std::numeric_limits<float>::min());
}

}  // namespace

QuantizedVolume quantize(std::span<const float> values, StoredType type) {
  const float largest = largest_sound_value(values);
  QuantizedVolume result;
  switch (type) {
    case StoredType::kFloat32:
      result.bytes = encode_each<float>(values, [](float value) { return value; });
      break;
    case StoredType::kFloat16:
      result.saturated = largest > kLargestHalf;
      result.bytes = encode_each<std::uint16_t>(
          values, [](float value) { return to_half(std::min(value, kLargestHalf)); });
      break;
    case StoredType::kUint8:
      result.scale = uint8_scale(largest);
      result.bytes = encode_each<std::uint8_t>(values, [scale = result.scale](float value) {
        return static_cast<std::uint8_t>(std::min(value / scale + 0.5f, 255.0f));
      });
      break;
  }
  return result;
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
