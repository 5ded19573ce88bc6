#pragma once

#include <cstddef>
#include <functional>

#include "manifests/plan.h"
#include "pipeline/profile/trace_recorder.h"
#include "pipeline/samples/sample_message.h"
#include "pipeline/stopping/stop_order.h"

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
  int generators = 1;         ///< calls of the generator at the same time; 1..threads
};

/// Samples that may be under way at once: enough to keep every thread busy while the writer commits
/// a shard, and not more than `budget_bytes` of them by their largest size; at least threads + 1.
std::size_t samples_in_flight(int threads, std::size_t sample_bytes, std::size_t budget_bytes);

/// Runs every sample of the shards that `next_shard` gives, until it gives nullptr, through the
/// flow graph of DESIGN section 3,
///   source → limiter → read → generate → finish → sequencer → write → limiter's decrement.
/// The limiter spans source to writer, since a queueing graph in front of a slow serial writer
/// holds every message alive. Failures of samples travel as values; an exception that leaves a body
/// or `next_shard` is a failure of the run: it cancels the graph and is rethrown here.
///
/// `next_shard` is called by one thread at a time, when the samples of the shard before are all
/// under way. `order` is asked before every step of every sample, by many threads:
///   kFinishShard  the source gives nothing more of any shard but the one whose sample reached the
///                 writer last; samples of later shards that are under way still come to `write`,
///                 which has to drop them;
///   kAbort        the source gives nothing more; messages pass the parallel bodies untouched and
///                 come to `write`, which has to drop them.
/// `trace` gets each body's work (SampleSpan) and the gauges of samples; null: nobody asks.
/// Returns the number of samples that left the source. Throws std::logic_error if fewer reached
/// `write`: a sample lost on the way would otherwise go unnoticed.
std::size_t run_conversion_graph(const std::function<const PlannedShard*()>& next_shard,
                                 const ConversionBodies& bodies, const GraphLimits& limits,
                                 const std::function<StopOrder()>& order,
                                 TraceRecorder* trace = nullptr);

}  // namespace eventgan
