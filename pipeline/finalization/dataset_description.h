#pragma once

#include <string>
#include <vector>

#include "pipeline/finalization/dataset_parts.h"
#include "stages/shards/view/dataset_view.h"

namespace eventgan {

inline constexpr char kDescriptionName[] = "dataset.json";
inline constexpr char kViewName[] = "dataset.h5";

/// The text of dataset.json (manifests/shard_format.md, "The whole dataset"): what the dataset is,
/// without any time or place, so that the same shards give the same bytes. Canonical JSON: sorted
/// keys, two-space indent, newline at the end. `parts` has at least one shard that is done;
/// `receipt` is the view file's. Throws std::runtime_error if the frozen manifest is no JSON.
std::string describe_dataset(const DatasetParts& parts, const std::vector<DatasetView>& views,
                             const ViewReceipt& receipt);

}  // namespace eventgan
