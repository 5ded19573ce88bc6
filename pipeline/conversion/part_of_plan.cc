#include "pipeline/conversion/part_of_plan.h"

#include <cstddef>
#include <iterator>

namespace eventgan {

PartOfPlan split_plan(const Plan& plan, const ShardPart& part) {
  std::vector<bool> is_of_part(plan.shards.size(), false);
  for (const int shard : shards_of(part, static_cast<int>(plan.shards.size()))) {
    is_of_part[static_cast<std::size_t>(shard)] = true;
  }
  PartOfPlan split;
  for (std::size_t i = 0; i < plan.shards.size(); ++i) {
    (is_of_part[i] ? split.part : split.elsewhere).push_back(&plan.shards[i]);
  }
  return split;
}

std::int64_t count_samples(const std::vector<const PlannedShard*>& shards) {
  std::int64_t count = 0;
  for (const PlannedShard* shard : shards) count += std::ssize(shard->samples);
  return count;
}

}  // namespace eventgan
