#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "pipeline/conversion/sample_stages.h"
#include "pipeline/conversion/shard_queue.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/runtime/progress.h"
#include "pipeline/runtime/stopping.h"
#include "pipeline/runtime/trace.h"
#include "stages/generator/generator.h"

namespace eventgan {

// ---- The run: from planned shards to a sink

/// How a run goes on, whatever it writes.
struct RunOptions {
  int threads = 0;      ///< 0: all cores
  double grace_s = 20;  ///< time after a request to stop, ≥ 0
  /// Seconds since the request to stop, if one has come (see StopSignal); called from several
  /// threads. None: nobody asks.
  std::function<std::optional<double>()> since_stop_request;
  /// Called with the number of pairs to do; shows progress. None: silent.
  std::function<std::unique_ptr<Progress>(std::int64_t)> make_progress;
  ShowPhase show_phase = {};  ///< of what comes before the first pair
  /// Told what a person should know: shards that are made again, volumes not to be trusted. None:
  /// silent.
  std::function<void(const std::string&)> warn = {};
  TraceRecorder* trace = nullptr;  ///< of every stage and thread; null: nobody asks

  bool stop_requested() const { return since_stop_request && since_stop_request().has_value(); }
};

/// What shards are made of, and where. All references must outlive the run.
struct ConversionJob {
  const JobManifest& manifest;
  const std::vector<std::unique_ptr<Dataset>>& datasets;  ///< one for each source
  const Generator& generator;
  const std::string& weights_hash;
  const std::filesystem::path& folder;
  const FrozenPlan& frozen;
  const RunOptions& options;
};

/// Writes the samples of a run into files, one shard after the other. For each shard `open` is
/// called, `add` for each of its samples in slot order, and `commit`. All of them throw
/// std::runtime_error if the disk fails. Thread safety: one thread at a time.
class SampleSink {
 public:
  virtual ~SampleSink() = default;
  virtual void open(const PlannedShard& shard) = 0;
  /// A sample that has passed all stages, or failed in one.
  virtual void add(const SampleMessage& message) = 0;
  /// Publishes the open shard. False if that was not needed: another worker has done it.
  virtual bool commit() = 0;
  /// Deletes the file under way, if any.
  virtual void abandon() = 0;
  /// Whether it takes no other shard; asked before the first and after each commit.
  virtual bool closed() const = 0;
};

/// Makes `shards` of the job's plan (or with some of their samples alone) and writes them to
/// `sink`, in their order: joins queue, stages, graph and stop orders. `shared` is the folder if
/// other workers may write to it, too (see ShardQueue); null: no other does. `name` is the run's in
/// the trace.
///
/// At the end it warns, once, if there were volumes with kFlagBeyondCalibration.
///
/// On a request to stop, the shard under way is finished within the grace period or abandoned (see
/// stop_order), and the run ends; also when the sink is closed. Returns the shards that others have
/// committed meanwhile. Throws std::runtime_error if a pair does not fit into memory (see
/// check_pairs_fit), the disk or the generator fails, and what the sink throws.
std::vector<const PlannedShard*> run_conversion(const char* name, const ConversionJob& job,
                                                const std::vector<const PlannedShard*>& shards,
                                                SampleSink& sink, SharedFolder* shared = nullptr);

// ---- What it consists of

struct GraphLimits {
  int threads = 1;            ///< the one budget of threads at work, the calling one included
  std::size_t in_flight = 2;  ///< samples between source and writer at most; ≥ 1
  int generators = 1;         ///< calls of the generator at the same time; ≥ 1
  int waiting = 0;            ///< threads beside these for calls that wait for a device
};

/// Limits for a graph over `shards`: enough samples under way to keep every one of `threads`
/// threads busy while the writer commits a shard, and not more of the largest ones than fit into a
/// gibibyte, at least threads + 1 unless these take more than half of `memory_bytes`; as many
/// generators at once as threads, and not more of them than fit into three quarters of
/// `memory_bytes` at the largest size, at least one. For a generator on a device its device_calls
/// take the place of the threads' calls, in threads of their own, since they do nothing but wait.
GraphLimits graph_limits(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                         int threads, std::size_t memory_bytes);

/// Throws std::runtime_error naming the frames if not even a single pair of one of the shards fits
/// into `memory_bytes`: the run would end there, and a system that is out of memory kills without a
/// word. It is no fault of the sample, to be quarantined: the bytes of a shard must not depend on
/// the machine that makes it.
void check_pairs_fit(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                     std::size_t memory_bytes);

/// What the graph runs; each body is called with one message at a time per thread.
struct ConversionBodies {
  std::function<void(SampleMessage&)> read;      ///< in parallel
  std::function<void(SampleMessage&)> generate;  ///< in parallel
  std::function<void(SampleMessage&)> finish;    ///< in parallel
  /// One at a time, in plan order; after false it gets no other.
  std::function<bool(SampleMessage&)> write;
};

/// Runs every sample of the shards that `next_shard` gives, until it gives nullptr, through the
/// graph
///   source → limiter → read → generate → finish → sequencer → write → limiter's decrement.
/// The limiter spans source to writer, since a queueing graph in front of a slow serial writer
/// holds every message alive. Failures of samples travel as values; an exception that leaves a body
/// or `next_shard` is a failure of the run: it cancels the graph and is rethrown here.
///
/// `next_shard` is called by one thread at a time, when the samples of the shard before are all
/// under way. `order` is asked before every step of every sample, by many threads, and obeyed here
/// and nowhere else:
///   kFinishShard  the source gives nothing more of any shard but the one whose sample reached the
///                 writer last; samples of later shards that are under way are dropped before
///                 `write`;
///   kAbort        the source gives nothing more; messages pass the parallel bodies untouched and
///                 are dropped before `write`.
/// `trace` gets each body's work (sample, shard and slot, the pixels and, once it is encoded, the
/// bytes of its volume, the time since the stage before as `waited_us`: in a queue, or for the turn
/// at the writer, and the fault if the sample failed here) and the gauges of samples; null: nobody
/// asks. Returns the number of samples that left the source. Throws std::logic_error if fewer
/// reached the writer: a sample lost on the way would otherwise go unnoticed.
std::size_t run_conversion_graph(const std::function<const PlannedShard*()>& next_shard,
                                 const ConversionBodies& bodies, const GraphLimits& limits,
                                 const std::function<StopOrder()>& order,
                                 TraceRecorder* trace = nullptr);

}  // namespace eventgan
