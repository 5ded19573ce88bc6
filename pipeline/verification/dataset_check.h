#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/output/output_folder.h"
#include "pipeline/output/shard_scan.h"

namespace eventgan {

/// What is wrong with dataset.json and dataset.h5 of an output folder: that they are not what
/// `finalize` makes of the plan and the markers, or do not go together. Lines "PATH: expected X,
/// got Y"; none if they are sound, or neither is there. `shards` as read_dataset_parts takes
/// them: none is opened that was not found sound.
std::vector<std::string> dataset_faults(const std::filesystem::path& folder, FrozenOutline frozen,
                                        std::vector<ShardState> shards);

}  // namespace eventgan
