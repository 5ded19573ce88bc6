#include "pipeline/retry/retry_work.h"

#include "pipeline/folder/shard_scan.h"

namespace eventgan {

QuarantinedSamples find_quarantined(const std::filesystem::path& folder,
                                    const FrozenOutline& frozen) {
  QuarantinedSamples found;
  const auto states = scan_shards(folder, frozen.plan.shards, frozen.hash);
  for (std::size_t i = 0; i < states.size(); ++i) {
    const ShardState& state = states[i];
    if (state.condition == ShardCondition::kMissing) ++found.shards_missing;
    found.damaged.insert(found.damaged.end(), state.faults.begin(), state.faults.end());
    if (!state.done() || state.marker->quarantined.empty()) continue;
    found.shards.push_back(i);
    found.count += std::ssize(state.marker->quarantined);
    for (const QuarantinedSample& sample : state.marker->quarantined) {
      found.ids.push_back(sample.sample_id);
    }
  }
  return found;
}

std::vector<PlannedShard> plan_retry(const std::vector<CommittedShard>& shards) {
  std::vector<PlannedShard> retried;
  for (const CommittedShard& committed : shards) {
    const PlannedShard& whole = *committed.shard;
    PlannedShard& part = retried.emplace_back(
        PlannedShard{whole.name, whole.source, whole.volume_size, {}, whole.size_unknown});
    for (const QuarantinedSample& quarantined : committed.marker.quarantined) {
      part.samples.push_back(whole.samples.at(static_cast<std::size_t>(quarantined.slot)));
    }
  }
  return retried;
}

}  // namespace eventgan
