#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "manifests/values/half.h"
#include "manifests/values/job.h"

namespace eventgan {

/// Largest finite IEEE 754 half.
inline constexpr float kLargestHalf = 65504;

/// The IEEE 754 half (binary16) nearest to `value`, ties to even, also among subnormals. `value`
/// must be in [0, 65504]. The same on every machine, whatever its instructions.
std::uint16_t to_half(float value);

/// The same of a number of either sign, |value| <= 65504.
Half half_of(float value);

/// halves[i] = to_half(min(values[i], 65504)) for finite values >= 0, with the processor's own
/// conversion where it has one. The same bits everywhere.
void to_halves(std::span<const float> values, std::uint16_t* halves);

/// Exact value of a half; infinities and NaN too.
float from_half(std::uint16_t half);

/// values[i] = from_half(halves[i]), likewise.
void from_halves(std::span<const std::uint16_t> halves, float* values);

/// How the values of one volume become stored numbers.
struct Quantization {
  StoredType type = StoredType::kFloat32;
  float scale = 1;         ///< value = code x scale (uint8); 1 for floats
  bool saturated = false;  ///< some value is beyond the type's range and gets clipped to it
  bool vanished = false;   ///< every value becomes zero, and not every one is
};

/// For a volume whose largest value is `largest`, finite and >= 0: uint8 codes as VolumeCodec
/// describes.
Quantization quantization(StoredType type, float largest);

/// The nearest number of the stored type for each value, in HDF5's shuffled order: byte b of the
/// number for values[i] goes to planes[b * plane_size + i] (see chunk_filters.h). Values must be
/// finite, >= 0 and at most the `largest` of the quantisation. Thread safe.
void quantize(std::span<const float> values, const Quantization& how, std::byte* planes,
              std::size_t plane_size);

/// The values again: of values.size() whole stored numbers, little endian, not shuffled. Thread
/// safe.
void dequantize(std::span<const std::byte> numbers, StoredType type, float scale,
                std::span<float> values);

}  // namespace eventgan
