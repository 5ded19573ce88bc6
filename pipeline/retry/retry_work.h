#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "manifests/marker.h"
#include "manifests/plan.h"
#include "pipeline/conversion/earlier_shards.h"
#include "pipeline/folder/output_folder.h"

namespace eventgan {

/// Where an output folder has quarantined samples, by its markers alone.
struct QuarantinedSamples {
  std::vector<std::size_t> shards;   ///< committed shards with any, by their place in the plan
  std::int64_t count = 0;            ///< in all of them
  std::vector<std::string> ids;      ///< of these samples, in plan order
  std::vector<std::string> damaged;  ///< "PATH: expected X, got Y" of shards that are not whole
  int shards_missing = 0;            ///< not made yet
};

QuarantinedSamples find_quarantined(const std::filesystem::path& folder,
                                    const FrozenOutline& frozen);

/// What to redo of each shard: the planned shard with its quarantined samples alone, in the order
/// of its marker, which says the slot of each.
std::vector<PlannedShard> plan_retry(const std::vector<CommittedShard>& shards);

}  // namespace eventgan
