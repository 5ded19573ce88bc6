#pragma once

#include <cstddef>
#include <vector>

#include "pipeline/samples/conversion_graph.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// Limits for a graph over `shards`: enough samples under way for `threads` threads, and not more
/// of the largest ones than fit into a gibibyte; as many generators at once as threads, and not
/// more of them than fit into three quarters of `memory_bytes` at the largest size, at least one.
GraphLimits graph_limits(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                         int threads, std::size_t memory_bytes);

}  // namespace eventgan
