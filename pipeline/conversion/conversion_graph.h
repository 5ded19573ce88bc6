#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "manifests/plan.h"
#include "pipeline/conversion/sample_message.h"

namespace eventgan {

/// What the graph runs; each body is called with one message at a time per thread.
struct ConversionBodies {
  std::function<void(SampleMessage&)> read;      ///< in parallel
  std::function<void(SampleMessage&)> generate;  ///< in parallel
  std::function<void(SampleMessage&)> finish;    ///< in parallel
  /// One at a time, in plan order; false stops the source (samples already under way still come).
  std::function<bool(SampleMessage&)> write;
};

struct GraphLimits {
  int threads = 1;            ///< the one budget of threads, the calling one included
  std::size_t in_flight = 2;  ///< samples between source and writer at most; ≥ 1
};

/// Samples that may be under way at once: enough to keep every thread busy while the writer commits
/// a shard, and not more than `budget_bytes` of them by their largest size; at least threads + 1.
std::size_t samples_in_flight(int threads, std::size_t sample_bytes, std::size_t budget_bytes);

/// Runs every sample of the shards through the flow graph of DESIGN section 3,
///   source → limiter → read → generate → finish → sequencer → write → limiter's decrement,
/// and returns the number of samples that reached the writer. The limiter spans source to writer,
/// since a queueing graph in front of a slow serial writer holds every message alive. Failures of
/// samples travel as values; an exception that leaves a body is a failure of the run: it cancels
/// the graph and is rethrown here.
std::size_t run_conversion_graph(const std::vector<const PlannedShard*>& shards,
                                 const ConversionBodies& bodies, const GraphLimits& limits);

}  // namespace eventgan
