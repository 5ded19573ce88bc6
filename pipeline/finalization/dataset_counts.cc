#include "pipeline/finalization/dataset_counts.h"

#include <numeric>

namespace eventgan {

void add(const ShardMarker& marker, DatasetCounts& counts) {
  ++counts.shards;
  counts.samples += marker.samples;
  counts.valid += marker.valid;
  counts.boxes += std::accumulate(marker.boxes.begin(), marker.boxes.end(), std::int64_t{0});
  counts.persons += std::accumulate(marker.persons.begin(), marker.persons.end(), std::int64_t{0});
  counts.size_bytes += marker.size_bytes;
  for (const auto& [name, boxes] : marker.classes) counts.classes[name] += boxes;
  for (const auto& [gap, samples] : marker.gaps) counts.gaps[gap] += samples;
}

}  // namespace eventgan
