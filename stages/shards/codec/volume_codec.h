#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "manifests/values/events.h"
#include "manifests/values/job.h"

namespace eventgan {

/// Where given values lie in a volume: values [whole.channels(), content.height, content.width], C
/// order, their top left pixel at (y, x) of each channel. Around them are zeros (no events), as in
/// letterbox's borders.
struct VolumeWindow {
  VolumeShape whole;
  ImageSize content;
  int x = 0;
  int y = 0;

  std::size_t value_count() const {
    return static_cast<std::size_t>(whole.channels()) * content.pixel_count();
  }
};

/// One volume as it is in the file: a whole HDF5 chunk after all filters.
struct EncodedVolume {
  std::vector<std::byte> chunk;
  float scale = 1;  ///< value = code x scale (uint8); 1 for floats
  /// Some value was beyond the type's range (float16: 65504) and clipped to it: the caller sets
  /// kFlagSaturated.
  bool saturated = false;
  /// There were values above zero, all too small for the type: zeros are stored. The caller sets
  /// kFlagVanished.
  bool vanished = false;
};

/// Quantises and compresses volumes: type, then HDF5's filters shuffle, deflate (zlib's format,
/// chunk_filters.h) and fletcher32, applied here so that they run in parallel and outside HDF5's
/// global lock. Any HDF5 reads the result with its own filters.
///
/// uint8: scale = largest value / 255 (1 for an empty volume), code = round(value / scale), so
/// nothing above zero is lost but what is below half a step; never a scale below the smallest
/// normal float. Deterministic. Thread safety: `encode` may be called from several threads; the
/// codec keeps working memory for as many calls as ran at once, twice a volume's codes each.
class VolumeCodec {
 public:
  /// `deflate_level` 0..9; 0 stores without the deflate filter.
  VolumeCodec(StoredType type, int deflate_level);
  ~VolumeCodec();
  VolumeCodec(const VolumeCodec&) = delete;
  VolumeCodec& operator=(const VolumeCodec&) = delete;

  /// A whole volume of any shape. Throws std::invalid_argument for values that are not finite or
  /// are below zero.
  EncodedVolume encode(std::span<const float> volume) const;

  /// The values in their window, zeros around them. They must be known to be finite and >= 0, with
  /// `largest` the largest (VolumeStatistics::max; 0 if there is none). Throws
  /// std::invalid_argument if there are not as many values as the window says, or it leaves the
  /// volume.
  EncodedVolume encode(std::span<const float> values, const VolumeWindow& window,
                       float largest) const;

 private:
  class Workspaces;

  /// The chunk of `count` numbers that `write_planes` puts in HDF5's shuffled order into a buffer.
  template <class WritePlanes>
  std::vector<std::byte> chunk(std::size_t count, WritePlanes write_planes) const;

  StoredType type_;
  int deflate_level_;
  std::unique_ptr<Workspaces> workspaces_;
};

/// The stored numbers of a chunk that went through those filters, little endian and in their order
/// (as `dequantize` takes them): `size_bytes` bytes. Nothing if it is no such chunk: another
/// checksum, damaged or of another size. Thread safe.
std::optional<std::vector<std::byte>> decode_chunk(std::span<const std::byte> chunk,
                                                   StoredType type, int deflate_level,
                                                   std::size_t size_bytes);

/// Likewise the volume.size() values, scale x number; false for what is no such chunk.
bool decode_volume(std::span<const std::byte> chunk, StoredType type, int deflate_level,
                   float scale, std::span<float> volume);

}  // namespace eventgan
