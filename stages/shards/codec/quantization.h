#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "manifests/job_manifest.h"

namespace eventgan {

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
/// number for values[i] goes to planes[b * plane_size + i] (see byte_planes.h). Values must be
/// finite, >= 0 and at most the `largest` of the quantisation. Thread safe.
void quantize(std::span<const float> values, const Quantization& how, std::byte* planes,
              std::size_t plane_size);

/// The values again. `bytes` holds whole stored numbers, little endian, not shuffled.
std::vector<float> dequantize(std::span<const std::byte> bytes, StoredType type, float scale);

}  // namespace eventgan
