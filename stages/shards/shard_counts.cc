#include "stages/shards/shard_counts.h"

#include "manifests/volume.h"

namespace eventgan {

ShardCounts count_shard(const ShardReader& reader) {
  const std::vector<std::string>& class_names = reader.header().label_schema.class_names;
  ShardCounts counts;
  for (int slot = 0; slot < reader.header().sample_count; ++slot) {
    const ShardSample sample = reader.sample(slot);
    counts.valid += sample.valid;
    counts.empty_volumes += sample.valid && (sample.statistics.flags & kFlagEmpty) != 0;
    if (!sample.valid) counts.quarantined.push_back(sample.sample_id);
    ++counts.gaps[sample.pair.gap_frames];
    counts.boxes += static_cast<std::int64_t>(sample.annotation.boxes.size());
    counts.persons += static_cast<std::int64_t>(sample.annotation.persons.size());
    for (const Box& box : sample.annotation.boxes) {
      ++counts.classes[class_names.at(static_cast<std::size_t>(box.class_id))];
    }
  }
  return counts;
}

std::vector<std::string> flag_names(std::uint32_t flags) {
  std::vector<std::string> names;
  if (flags & kFlagEmpty) names.emplace_back("empty");
  if (flags & kFlagExtrapolated) names.emplace_back("extrapolated");
  if (flags & kFlagSaturated) names.emplace_back("saturated");
  if (flags & kFlagVanished) names.emplace_back("vanished");
  return names;
}

}  // namespace eventgan
