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
  std::map<int, ShardHeader> headers;  ///< by source: the header of its first finished shard

  const SourceSpec& source_of(const ShardOutline& shard) const {
    return manifest.sources.at(static_cast<std::size_t>(shard.source));
  }
};

/// Looks at an output folder: the plan without its samples, every marker, and one shard of each
/// source; no other shard is opened. Throws InputError if there is no plan, std::runtime_error
/// naming the file if the plan or a shard that is looked at is damaged.
DatasetParts read_dataset_parts(const std::filesystem::path& folder);

}  // namespace eventgan
