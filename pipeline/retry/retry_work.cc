#include "pipeline/retry/retry_work.h"

#include <map>
#include <string_view>
#include <utility>

#include "pipeline/output/shard_states.h"

namespace eventgan {
namespace {

using SampleKey = std::pair<int, std::string_view>;  // source and id

bool is_hole(const PlannedSample& sample) { return !sample.fault.empty(); }

const PlannedSample& planned_sample(const CommittedShard& shard, const QuarantinedSample& sample) {
  return shard.shard->samples.at(static_cast<std::size_t>(sample.slot));
}

/// What `today` has for the samples that were planned with a fault; null where it has none.
std::map<SampleKey, const PlannedSample*> find_holes(const std::vector<CommittedShard>& shards,
                                                     const Plan& today) {
  std::map<SampleKey, const PlannedSample*> found;
  for (const CommittedShard& shard : shards) {
    for (const QuarantinedSample& quarantined : shard.marker.quarantined) {
      const PlannedSample& sample = planned_sample(shard, quarantined);
      if (is_hole(sample)) found[{shard.shard->source, sample.sample_id}] = nullptr;
    }
  }
  if (found.empty()) return found;
  for (const PlannedShard& shard : today.shards) {
    for (const PlannedSample& sample : shard.samples) {
      const auto wanted = found.find({shard.source, sample.sample_id});
      if (wanted != found.end()) wanted->second = &sample;
    }
  }
  return found;
}

}  // namespace

QuarantinedSamples find_quarantined(const std::filesystem::path& folder,
                                    const FrozenOutline& frozen) {
  QuarantinedSamples found;
  const std::vector<ShardState> states = shard_states(folder, frozen);
  for (std::size_t i = 0; i < states.size(); ++i) {
    const ShardState& state = states[i];
    if (state.condition == ShardCondition::kMissing) ++found.shards_missing;
    if (!state.fault.empty()) found.damaged.push_back(state.fault);
    if (!state.done() || state.marker->quarantined.empty()) continue;
    found.shards.push_back(i);
    found.count += std::ssize(state.marker->quarantined);
    for (const QuarantinedSample& sample : state.marker->quarantined) {
      found.ids.push_back(sample.sample_id);
    }
  }
  return found;
}

std::vector<RetriedShard> plan_retry(const std::vector<CommittedShard>& shards, const Plan& today) {
  const auto holes = find_holes(shards, today);
  std::vector<RetriedShard> retried;
  for (const CommittedShard& committed : shards) {
    const PlannedShard& planned = *committed.shard;
    RetriedShard shard{
        committed.marker,
        {planned.name, planned.source, planned.volume_size, {}, planned.size_unknown},
        {}};
    for (const QuarantinedSample& quarantined : committed.marker.quarantined) {
      const PlannedSample* sample = &planned_sample(committed, quarantined);
      if (is_hole(*sample)) {
        const PlannedSample* known = holes.at({planned.source, sample->sample_id});
        if (known) sample = known;
      }
      shard.samples.samples.push_back(*sample);
      shard.slots.push_back(quarantined.slot);
    }
    retried.push_back(std::move(shard));
  }
  return retried;
}

}  // namespace eventgan
