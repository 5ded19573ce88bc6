#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/job_manifest.h"
#include "manifests/marker.h"
#include "manifests/shard.h"
#include "pipeline/output/amendments.h"
#include "pipeline/output/output_folder.h"
#include "pipeline/output/shard_scan.h"

namespace eventgan {

/// What a dataset is put together from.
struct DatasetParts {
  FrozenOutline frozen;
  JobManifest manifest;  ///< that of the run that froze the plan
  std::vector<Amendment> amendments;
  std::vector<ShardState> done;        ///< in plan order
  std::vector<ShardState> missing;     ///< the plan's other shards, in plan order
  std::map<int, ShardHeader> headers;  ///< by source: of its first shard that is sound

  const SourceSpec& source_of(const ShardOutline& shard) const {
    return manifest.sources.at(static_cast<std::size_t>(shard.source));
  }
};

/// Puts together what is known of an output folder whose plan is `frozen`. `shards`: each shard of
/// the plan, from a scan that has read it. Of one shard of each source the header is read: of the
/// first that is sound, so that its bytes are its marker's; and of each sound one whose size was
/// unknown at planning: its outline then has the file's, that of one that is not sound {0, 0}.
/// Throws std::runtime_error naming the file if the plan's manifest or such a shard is not as it
/// should be.
DatasetParts read_dataset_parts(const std::filesystem::path& folder, FrozenOutline frozen,
                                std::vector<ShardState> shards);

}  // namespace eventgan
