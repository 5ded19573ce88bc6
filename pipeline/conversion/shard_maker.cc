#include "pipeline/conversion/shard_maker.h"

#include <iterator>
#include <memory>
#include <utility>

#include "pipeline/conversion/part_of_plan.h"
#include "pipeline/conversion/shard_header.h"
#include "pipeline/memory/memory_limit.h"
#include "pipeline/profile/trace_span.h"
#include "pipeline/samples/conversion_graph.h"

namespace eventgan {

ShardMaker::ShardMaker(const ConversionJob& job, EarlierShards earlier,
                       std::int64_t quarantined_before)
    : job_(job),
      limits_(graph_limits(earlier.left, job.generator, job.threads, memory_limit_bytes())),
      stages_(job.manifest, job.datasets, job.generator, static_cast<int>(limits_.in_flight)),
      shared_(job.folder, job.frozen.hash, std::move(earlier.distrusted)),
      pace_(job.threads),
      monitor_(job.options.since_stop_request, job.options.grace_s,
               [this] { return pace_.work_left(); }),
      sink_(sink_setup(quarantined_before), pace_),
      to_do_(sink_.closed() ? 0 : count_samples(earlier.left)),
      queue_(sink_.closed() ? std::vector<const PlannedShard*>() : std::move(earlier.left),
             [this](const PlannedShard& shard) { return look_at(shard); }) {}

SinkSetup ShardMaker::sink_setup(std::int64_t quarantined_before) {
  SinkSetup setup;
  setup.folder = job_.folder;
  setup.plan_hash = job_.frozen.hash;
  setup.errors = job_.manifest.errors;
  setup.planned = job_.frozen.plan.sample_count();
  setup.quarantined_before = quarantined_before;
  setup.header_of = [this](const PlannedShard& shard) {
    const Dataset& dataset = *job_.datasets[static_cast<std::size_t>(shard.source)];
    return make_shard_header(job_.manifest, shard, job_.frozen, dataset.label_schema(),
                             job_.weights_hash, job_.generator.description());
  };
  setup.order = [this] { return monitor_.order(); };
  setup.opened = [this](const PlannedShard& shard) { shared_.opened(shard); };
  setup.trace = job_.options.trace;
  setup.is_done = [this](const PlannedShard& shard) { return shared_.is_done(shard); };
  return setup;
}

ShardActivity ShardMaker::look_at(const PlannedShard& shard) {
  // After a request to stop nothing of it will be written, so no time is lost on looking.
  if (monitor_.order() != StopOrder::kGoOn) return ShardActivity::kFree;
  const ShardActivity activity = shared_.look_at(shard);
  if (activity == ShardActivity::kDone) left_out_ += std::ssize(shard.samples);
  return activity;
}

void ShardMaker::make() {
  const auto& make_progress = job_.options.make_progress;
  const std::unique_ptr<Progress> progress =
      make_progress && to_do_ > 0 ? make_progress(to_do_) : nullptr;
  run_graph(progress.get());
  sink_.abandon();
  if (!progress) return;
  progress->set_total(to_do_ - left_out_);
  progress->finish();
}

void ShardMaker::run_graph(Progress* progress) {
  const TraceSpan span(job_.options.trace, "make shards", "job");
  run_conversion_graph([this] { return queue_.next(); },
                       {[this](SampleMessage& message) { stages_.read(message); },
                        [this](SampleMessage& message) { stages_.generate(message); },
                        [this](SampleMessage& message) { stages_.finish(message); },
                        [&](SampleMessage& message) {
                          if (sink_.accept(message) && progress) {
                            progress->set_total(to_do_ - left_out_);
                            progress->advance(message.failed(), std::ssize(message.chunk));
                          }
                          return !sink_.closed();
                        }},
                       limits_, [this] { return monitor_.order(); }, job_.options.trace);
}

std::vector<const PlannedShard*> ShardMaker::done_by_others() const {
  std::vector<const PlannedShard*> shards = sink_.done_by_others();
  shards.insert(shards.end(), queue_.done_by_others().begin(), queue_.done_by_others().end());
  return shards;
}

}  // namespace eventgan
