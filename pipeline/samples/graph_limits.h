#pragma once

#include <cstddef>
#include <vector>

#include "pipeline/samples/conversion_graph.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// Limits for a graph over `shards`: enough samples under way for `threads` threads, and not more
/// of the largest ones than fit into a gibibyte, at least threads + 1 unless these take more than
/// half of `memory_bytes`; as many generators at once as threads, and not more of them than fit
/// into three quarters of `memory_bytes` at the largest size, at least one.
GraphLimits graph_limits(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                         int threads, std::size_t memory_bytes);

/// Throws std::runtime_error naming the frames if not even a single pair of one of the shards fits
/// into `memory_bytes`: the run would end there, and a system that is out of memory kills without a
/// word. It is no fault of the sample, to be quarantined: the bytes of a shard must not depend on
/// the machine that makes it.
void check_pairs_fit(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                     std::size_t memory_bytes);

}  // namespace eventgan
