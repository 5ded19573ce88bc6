#include "pipeline/samples/graph_limits.h"

#include <algorithm>

#include "manifests/volume.h"

namespace eventgan {
namespace {

constexpr std::size_t kInFlightBytes = std::size_t{1} << 30;
/// A sample's volume stands in memory about this often while it is generated, finished and encoded.
constexpr std::size_t kVolumeCopies = 3;

}  // namespace

GraphLimits graph_limits(const std::vector<const PlannedShard*>& shards, int bins, int threads) {
  std::size_t largest = 1;
  for (const PlannedShard* shard : shards) {
    const VolumeShape shape{bins, shard->volume_size};
    largest = std::max(largest, kVolumeCopies * shape.value_count() * sizeof(float));
  }
  return {threads, samples_in_flight(threads, largest, kInFlightBytes)};
}

}  // namespace eventgan
