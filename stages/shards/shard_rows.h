#pragma once

#include "manifests/values/shard.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// Adds the next sample's row to every table. Throws std::logic_error naming the sample if its
/// labels do not fit the header's schema or `labels` does not go with `annotation`; the tables are
/// then unchanged. A sample that is not valid may come without `labels`: then only the original
/// annotation is kept of it.
void append_row(const ShardHeader& header, const ShardSample& sample, ShardTables& tables);

/// Row `slot` as it was appended. Outlines are in float32, and those of the annotated boxes are
/// mapped back from the volume; what label_faults finds to be no outline is left out. The tables
/// must be consistent, as ShardReader sees to.
ShardSample extract_row(const ShardHeader& header, const ShardTables& tables, int slot);

}  // namespace eventgan
