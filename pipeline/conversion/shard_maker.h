#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/conversion/convert.h"
#include "pipeline/conversion/earlier_shards.h"
#include "pipeline/conversion/shard_sink.h"
#include "pipeline/conversion/shared_folder.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/planning/make_plan.h"
#include "pipeline/samples/graph_limits.h"
#include "pipeline/samples/sample_stages.h"
#include "pipeline/stopping/shard_pace.h"
#include "pipeline/stopping/stop_monitor.h"
#include "pipeline/workers/shard_queue.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// What shards are made of.
struct ConversionJob {
  const JobManifest& manifest;
  const ConversionOptions& options;
  const std::filesystem::path& folder;
  const FrozenPlan& frozen;
  const std::vector<std::unique_ptr<Dataset>>& datasets;  ///< one for each source
  const Generator& generator;
  const std::string& weights_hash;
  int threads = 1;
};

/// Makes the shards that earlier runs have left, in a folder that other workers may share: joins
/// queue, graph, sink and stop orders.
class ShardMaker {
 public:
  /// The job must outlive it. `quarantined_before`: in all shards of the plan that are done.
  ShardMaker(const ConversionJob& job, EarlierShards earlier, std::int64_t quarantined_before);

  /// Once. Ends early on a request to stop, or when the limits for quarantined samples are passed.
  void make();

  const std::vector<CommittedShard>& made() const { return sink_.committed(); }

  /// Shards that other workers have committed meanwhile.
  std::vector<const PlannedShard*> done_by_others() const;

 private:
  SinkSetup sink_setup(std::int64_t quarantined_before);
  ShardActivity look_at(const PlannedShard& shard);
  void run_graph(Progress* progress);

  const ConversionJob& job_;
  GraphLimits limits_;
  SampleStages stages_;
  SharedFolder shared_;
  ShardPace pace_;
  StopMonitor monitor_;
  ShardSink sink_;
  std::int64_t to_do_;                      // samples
  std::atomic<std::int64_t> left_out_ = 0;  // of those, made by others meanwhile
  ShardQueue queue_;
};

}  // namespace eventgan
