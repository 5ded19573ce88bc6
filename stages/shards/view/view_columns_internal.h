#pragma once

#include "stages/hdf5/hdf5_internal.h"
#include "stages/shards/view/dataset_view.h"

namespace eventgan {

/// Creates the volume and all columns of a shard (shard_columns.h) in the view's group, which has
/// the groups they stand in. Every column goes one of two ways: what the layout knows from the
/// markers is written, the rest is mapped; an optional one only if some shard has it. 4,000 shards
/// take about 1 s and 15 MB. Throws Hdf5Error.
void write_view_columns(hid_t group, const DatasetView& view);

}  // namespace eventgan
