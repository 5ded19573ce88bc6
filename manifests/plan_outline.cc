#include "manifests/plan_outline.h"

#include "manifests/plan_lines_internal.h"

namespace eventgan {

std::int64_t PlanOutline::sample_count() const {
  std::int64_t count = 0;
  for (const ShardOutline& shard : shards) count += shard.samples;
  return count;
}

ShardOutline outline_of(const PlannedShard& shard) {
  return {shard.name, shard.source, shard.volume_size, static_cast<int>(shard.samples.size()),
          shard.size_unknown};
}

std::vector<ShardOutline> outlines_of(const std::vector<const PlannedShard*>& shards) {
  std::vector<ShardOutline> outlines;
  for (const PlannedShard* shard : shards) outlines.push_back(outline_of(*shard));
  return outlines;
}

PlanOutline outline_of(const Plan& plan) {
  PlanOutline outline{plan.name, plan.manifest_text, plan.fingerprint, plan.sources, {}};
  outline.shards.reserve(plan.shards.size());
  for (const PlannedShard& shard : plan.shards) outline.shards.push_back(outline_of(shard));
  return outline;
}

PlanOutline read_plan_outline(std::istream& stream, const std::string& name) {
  return read_plan_lines(stream, name, {});
}

}  // namespace eventgan
