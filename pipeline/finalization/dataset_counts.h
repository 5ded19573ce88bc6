#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "manifests/marker.h"

namespace eventgan {

/// Sums over the shards of a dataset, or of a part of it. Boxes, persons and gaps of quarantined
/// samples count.
struct DatasetCounts {
  int shards = 0;
  std::int64_t samples = 0;
  std::int64_t valid = 0;
  std::int64_t boxes = 0;
  std::int64_t persons = 0;
  std::int64_t size_bytes = 0;                  ///< of the shards' files
  std::map<std::string, std::int64_t> classes;  ///< boxes by class name; only names that occur
  std::map<int, std::int64_t> gaps;             ///< samples by gap in frames

  std::int64_t quarantined() const { return samples - valid; }
  bool operator==(const DatasetCounts&) const = default;
};

/// Adds what a shard holds.
void add(const ShardMarker& marker, DatasetCounts& counts);

}  // namespace eventgan
