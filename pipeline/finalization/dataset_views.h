#pragma once

#include <vector>

#include "pipeline/finalization/dataset_parts.h"
#include "stages/shards/view/dataset_view.h"

namespace eventgan {

/// The shards that are done, those that are alike together: of one kind of dataset, one size of
/// volumes, one schema of labels. Views come in the order of their first shard. A single one stands
/// at the file's root; of several each has a group named after dataset and size,
/// "kitti_object-375x1242" (and "-2", "-3"... where schemas differ). Throws as lay_out_view does.
std::vector<DatasetView> views_of(const DatasetParts& parts);

}  // namespace eventgan
