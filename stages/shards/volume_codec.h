#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "manifests/job_manifest.h"
#include "manifests/volume.h"

namespace eventgan {

/// One volume as it stands in the file: a whole HDF5 chunk after all filters.
struct EncodedVolume {
  std::vector<std::byte> chunk;
  float scale = 1;  ///< value = code x scale (uint8); 1 for floats
  /// Some value was beyond the type's range (float16: 65504) and clipped to it: the caller sets
  /// kFlagSaturated.
  bool saturated = false;
};

/// Quantises and compresses volumes: type, then HDF5's filters shuffle, deflate (with libdeflate,
/// in zlib's format) and fletcher32, applied here so that they run in parallel and outside HDF5's
/// global lock. Any HDF5 reads the result with its own filters.
///
/// uint8: scale = largest value / 255 (1 for an empty volume), code = round(value / scale), so
/// nothing above zero is lost but what is below half a step; never a scale below the smallest
/// normal float. Throws std::invalid_argument for values that are not finite or below zero.
/// Deterministic. Thread safety: `encode` may be called from several threads.
class VolumeCodec {
 public:
  /// `deflate_level` 0..9; 0 stores without the deflate filter.
  VolumeCodec(StoredType type, int deflate_level);

  EncodedVolume encode(std::span<const float> volume) const;

 private:
  StoredType type_;
  int deflate_level_;
};

}  // namespace eventgan
