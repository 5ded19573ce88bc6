#include "pipeline/samples/graph_limits.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "manifests/volume.h"

namespace eventgan {
namespace {

constexpr std::size_t kInFlightBytes = std::size_t{1} << 30;
/// A sample is one volume from the generator on, then its chunk, which is hardly ever larger; both
/// stand for a moment while it is finished. Beside that its frames are little, those that are kept
/// for other pairs included. (The codec's working memory belongs to the threads.)
constexpr std::size_t kVolumeCopies = 2;

}  // namespace

GraphLimits graph_limits(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                         int threads, std::size_t memory_bytes) {
  std::size_t sample_bytes = 1;
  std::size_t generator_bytes = 1;
  for (const PlannedShard* shard : shards) {
    const VolumeShape shape{generator.bins(), shard->volume_size};
    sample_bytes = std::max(sample_bytes, kVolumeCopies * shape.value_count() * sizeof(float));
    generator_bytes = std::max(generator_bytes, generator.working_bytes(shard->volume_size));
  }
  const std::size_t generators = memory_bytes / 4 * 3 / generator_bytes;
  const std::size_t most = std::max<std::size_t>(memory_bytes / 2 / sample_bytes, 1);
  return {
      threads, std::min(samples_in_flight(threads, sample_bytes, kInFlightBytes), most),
      static_cast<int>(std::clamp<std::size_t>(generators, 1, static_cast<std::size_t>(threads)))};
}

void check_pairs_fit(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                     std::size_t memory_bytes) {
  for (const PlannedShard* shard : shards) {
    if (shard->samples.empty()) continue;
    const ImageSize size = shard->volume_size;
    const std::size_t volume_bytes =
        VolumeShape{generator.bins(), size}.value_count() * sizeof(float);
    const std::size_t needed =
        volume_bytes + std::max(generator.working_bytes(size), (kVolumeCopies - 1) * volume_bytes);
    if (needed <= memory_bytes) continue;
    const PlannedSample& sample = shard->samples.front();
    throw std::runtime_error(
        "expected pairs that fit into memory, " + std::to_string(memory_bytes) + " bytes, got " +
        std::to_string(size.width) + "x" + std::to_string(size.height) + ", which take about " +
        std::to_string(needed) + ", in " + sample.pair.previous.path + " and " +
        sample.pair.next.path + " (" + sample.sample_id +
        "): smaller $.image.width and height, or a machine with more memory");
  }
}

}  // namespace eventgan
