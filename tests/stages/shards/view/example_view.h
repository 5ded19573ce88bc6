#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stages/shards/dataset_view.h"

namespace eventgan::testing {

/// Three shards of the example's samples (example_shard.h), written into `folder`, and their view:
///   demo-train-00000-of-00002.h5   all five, the third in quarantine
///   demo-val-00000-of-00001.h5     the fourth and the fifth
///   demo-train-00001-of-00002.h5   the second and the fourth: no person, so no optional column
/// in the order of the plan; the view has both shards of "train" first.
DatasetView write_example_view_shards(const std::filesystem::path& folder, StoredType type,
                                      const std::string& group = "");

/// One shard of a source without labels, other-train-00000-of-00001.h5, in float32.
DatasetView write_unlabelled_view_shard(const std::filesystem::path& folder,
                                        const std::string& group);

}  // namespace eventgan::testing
