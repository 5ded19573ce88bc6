#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "manifests/job_manifest.h"

namespace eventgan {

/// Values as stored numbers: little endian, in the order of the values.
struct QuantizedVolume {
  std::vector<std::byte> bytes;
  float scale = 1;         ///< value = code x scale (uint8); 1 for floats
  bool saturated = false;  ///< some value was beyond the type's range and clipped to it
};

/// The nearest number of the stored type for each value; for uint8 as VolumeCodec describes.
/// Throws std::invalid_argument for a value that is not finite or is below zero. Thread safe.
QuantizedVolume quantize(std::span<const float> values, StoredType type);

/// The values again. `bytes` holds whole stored numbers.
std::vector<float> dequantize(std::span<const std::byte> bytes, StoredType type, float scale);

}  // namespace eventgan
