#pragma once

#include <cstdint>
#include <vector>

#include "manifests/plan.h"
#include "pipeline/workers/shard_part.h"

namespace eventgan {

/// A plan's shards by whether they are one worker's, each in plan order; they point into the plan.
struct PartOfPlan {
  std::vector<const PlannedShard*> part;
  std::vector<const PlannedShard*> elsewhere;
};

PartOfPlan split_plan(const Plan& plan, const ShardPart& part);

std::int64_t count_samples(const std::vector<const PlannedShard*>& shards);

}  // namespace eventgan
