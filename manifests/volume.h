#pragma once

#include <cstddef>
#include <cstdint>

#include "manifests/image_size.h"

namespace eventgan {

/// Shape of an event volume: [2 bins, height, width], C order. Channels 0..bins-1 are the positive
/// polarity in time order, bins..2 bins-1 the negative one.
struct VolumeShape {
  int bins = 0;
  ImageSize size;

  int channels() const { return 2 * bins; }
  std::size_t value_count() const {
    return static_cast<std::size_t>(channels()) * size.pixel_count();
  }
  bool operator==(const VolumeShape&) const = default;
};

/// What was noteworthy about a stored volume; bits of `/events/statistics/flags`.
enum VolumeFlag : std::uint32_t {
  kFlagEmpty = 1u << 0,         ///< no value is different from zero
  kFlagExtrapolated = 1u << 1,  ///< a gap that the generator never saw in training
  kFlagSaturated = 1u << 2,     ///< values beyond the stored type's range were clipped to it
  kFlagVanished = 1u << 3,      ///< all values became zeros in the stored type, too small for it
};

/// Numbers about one volume as generated, before it is quantised for storage.
struct VolumeStatistics {
  float eta98 = 0;  ///< 98th percentile of the non-zero values (DESIGN section 5); 0 if empty
  float max = 0;    ///< largest value
  float nonzero_fraction = 0;  ///< share of values that are not zero, 0..1
  double sum_positive = 0;     ///< sum over the positive-polarity channels
  double sum_negative = 0;     ///< sum over the negative-polarity channels
  std::uint32_t flags = 0;     ///< VolumeFlag bits
};

}  // namespace eventgan
