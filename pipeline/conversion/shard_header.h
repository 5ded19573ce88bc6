#pragma once

#include <string>

#include "manifests/job_manifest.h"
#include "manifests/shard.h"
#include "pipeline/folder/output_folder.h"

namespace eventgan {

/// The header of a planned shard of a job. `label_schema` is that of the shard's source,
/// `generator` the Generator's description.
ShardHeader make_shard_header(const JobManifest& manifest, const PlannedShard& shard,
                              const FrozenPlan& frozen, const LabelSchema& label_schema,
                              const std::string& weights_hash, const std::string& generator);

}  // namespace eventgan
