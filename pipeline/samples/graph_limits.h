#pragma once

#include <vector>

#include "pipeline/samples/conversion_graph.h"

namespace eventgan {

/// Limits for a graph over `shards` with volumes of `bins` bins a polarity: enough samples under
/// way for `threads` threads, and not more of the largest ones than fit into a gibibyte.
GraphLimits graph_limits(const std::vector<const PlannedShard*>& shards, int bins, int threads);

}  // namespace eventgan
