#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/job_manifest.h"
#include "manifests/marker.h"
#include "manifests/plan_outline.h"
#include "manifests/shard.h"
#include "pipeline/output/amendments.h"
#include "pipeline/output/output_folder.h"
#include "pipeline/output/shard_state.h"

namespace eventgan {

/// A shard of the plan that is done.
struct FinishedShard {
  ShardOutline outline;
  ShardMarker marker;
};

/// A shard of the plan that is not done.
struct MissingShard {
  std::string name;
  std::string why;  ///< "missing", or what is wrong with what there is
};

/// What a dataset is put together from.
struct DatasetParts {
  FrozenOutline frozen;
  JobManifest manifest;  ///< that of the run that froze the plan
  std::vector<Amendment> amendments;
  std::vector<FinishedShard> shards;   ///< in plan order
  std::vector<MissingShard> missing;   ///< in plan order
  std::map<int, ShardHeader> headers;  ///< by source: of its first finished shard that is sound

  const SourceSpec& source_of(const ShardOutline& shard) const {
    return manifest.sources.at(static_cast<std::size_t>(shard.source));
  }
};

/// Puts together what is known of an output folder whose plan is `frozen`. `states`: of each shard
/// of the plan; those that are done are finished. Of one shard of each source the header is read:
/// of the first that is finished and `sound`, that is, whose bytes were found to be its marker's;
/// and of each sound one whose size was unknown at planning: its outline then has the file's,
/// that of one that is not sound {0, 0}.
/// Throws std::runtime_error naming the file if the plan's manifest or such a shard is not as it
/// should be.
DatasetParts read_dataset_parts(const std::filesystem::path& folder, FrozenOutline frozen,
                                std::vector<ShardState> states, const std::vector<bool>& sound);

/// The same, after every shard was read (see proven_shard_state): those that are not what their
/// markers say are missing.
DatasetParts read_dataset_parts(const std::filesystem::path& folder, FrozenOutline frozen);

}  // namespace eventgan
