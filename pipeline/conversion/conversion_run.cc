#include "pipeline/conversion/conversion_run.h"

#include <fmt/core.h>
#include <oneapi/tbb/flow_graph.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <iterator>
#include <stdexcept>

#include "manifests/values/events.h"
#include "pipeline/runtime/handover.h"
#include "pipeline/runtime/memory.h"
#include "pipeline/runtime/threads.h"
#include "pipeline/runtime/trace.h"

namespace eventgan {
namespace {

namespace flow = oneapi::tbb::flow;
using Message = std::shared_ptr<SampleMessage>;

constexpr std::size_t kInFlightBytes = std::size_t{1} << 30;
/// A sample is one volume from the generator on, then its chunk, which is hardly ever larger; both
/// stand for a moment while it is finished. Beside that its frames are little, those that are kept
/// for other pairs included. (The codec's working memory belongs to the threads.)
constexpr std::size_t kVolumeCopies = 2;

/// Walks the shards' samples.
class Cursor {
 public:
  explicit Cursor(const std::function<const PlannedShard*()>& next_shard)
      : next_shard_(next_shard) {}

  /// The next message, or none at the end. `at_writer`: the shard that the writer is at.
  Message next(StopOrder order, const PlannedShard* at_writer) {
    if (order == StopOrder::kAbort) return nullptr;
    if (order == StopOrder::kFinishShard && shard_ != at_writer) return nullptr;
    while (!shard_ || slot_ == shard_->samples.size()) {
      if (order != StopOrder::kGoOn) return nullptr;
      shard_ = next_shard_();
      slot_ = 0;
      if (!shard_) return nullptr;
    }
    Message message(new SampleMessage, [](SampleMessage* done) {
      take_over(done);
      delete done;
    });
    message->number = number_++;
    message->shard = shard_;
    message->slot = static_cast<int>(slot_++);
    hand_over(message.get());
    return message;
  }

  std::size_t handed_out() const { return number_; }

 private:
  const std::function<const PlannedShard*()>& next_shard_;
  const PlannedShard* shard_ = nullptr;
  std::size_t slot_ = 0;
  std::size_t number_ = 0;
};

/// Records its own scope as one stage's work on one sample, and counts it among the samples at
/// work. Does nothing without a recorder.
class SampleSpan {
 public:
  SampleSpan(TraceRecorder* trace, Stage stage, SampleMessage& message)
      : trace_(trace),
        message_(message),
        failed_before_(message.failed()),
        span_(trace, kStageNames[static_cast<std::size_t>(stage)], "sample") {
    if (!trace_) return;
    ++trace_->gauges().samples_at_work;
    span_.note("sample", message.planned().sample_id);
    span_.note("shard", message.shard->name);
    span_.note("slot", message.slot);
    span_.note("pixels", static_cast<std::int64_t>(message.shard->volume_size.pixel_count()));
    if (message.traced_ns > 0) {
      span_.note("waited_us", (trace_->now_ns() - message.traced_ns) / 1000);
    }
  }

  ~SampleSpan() {
    if (!trace_) return;
    if (!message_.chunk.empty()) span_.note("bytes", std::ssize(message_.chunk));
    if (message_.failed() && !failed_before_) span_.note("fault", message_.sample.fault);
    message_.traced_ns = trace_->now_ns();
    --trace_->gauges().samples_at_work;
  }

  SampleSpan(const SampleSpan&) = delete;
  SampleSpan& operator=(const SampleSpan&) = delete;

 private:
  TraceRecorder* trace_;
  SampleMessage& message_;
  bool failed_before_;
  TraceSpan span_;
};

std::size_t run_graph(const std::function<const PlannedShard*()>& next_shard,
                      const ConversionBodies& bodies, const GraphLimits& limits,
                      const std::function<StopOrder()>& order, TraceRecorder* trace) {
  flow::graph graph;
  Cursor cursor(next_shard);
  std::atomic<bool> stop = false;
  std::atomic<const PlannedShard*> at_writer = nullptr;
  std::size_t arrived = 0;  // touched by the serial writer alone
  const Tasks tasks;

  flow::input_node<Message> source(graph, [&](oneapi::tbb::flow_control& control) -> Message {
    const Tasks::Work work(tasks, &cursor);
    const StopOrder now = order();  // before at_writer is read, else an order that comes between
                                    // finds no shard at the writer and breaks off its first one
    Message message = stop ? nullptr : cursor.next(now, at_writer);
    if (!message) control.stop();
    if (message && trace) ++trace->gauges().samples_in_flight;
    return message;
  });
  flow::limiter_node<Message> limiter(graph, limits.in_flight);
  const auto parallel = [&](Stage stage, int at_once,
                            const std::function<void(SampleMessage&)>& body) {
    return flow::function_node<Message, Message>(
        graph, static_cast<std::size_t>(at_once),
        [&body, &order, &tasks, stage, trace](Message message) {
          const Tasks::Work work(tasks, message.get());
          if (order() == StopOrder::kAbort) return message;
          const SampleSpan span(trace, stage, *message);
          body(*message);
          return message;
        });
  };
  auto read = parallel(Stage::kRead, limits.threads, bodies.read);
  auto generate = parallel(Stage::kGenerate, limits.generators, bodies.generate);
  auto finish = parallel(Stage::kFinish, limits.threads, bodies.finish);
  flow::sequencer_node<Message> sequencer(graph,
                                          [](const Message& message) { return message->number; });
  flow::function_node<Message, flow::continue_msg> write(
      graph, flow::serial, [&](const Message& message) {
        const Tasks::Work work(tasks, message.get()), in_turn(tasks, &arrived);
        ++arrived;
        at_writer = message->shard;
        const SampleSpan span(trace, Stage::kWrite, *message);
        const StopOrder now = order();
        const bool begins_shard = message->slot == 0;
        if (now == StopOrder::kAbort || (now == StopOrder::kFinishShard && begins_shard))
          stop = true;
        if (!stop && !bodies.write(*message)) stop = true;
        if (trace) --trace->gauges().samples_in_flight;
        return flow::continue_msg();
      });

  flow::make_edge(source, limiter);
  flow::make_edge(limiter, read);
  flow::make_edge(read, generate);
  flow::make_edge(generate, finish);
  flow::make_edge(finish, sequencer);
  flow::make_edge(sequencer, write);
  flow::make_edge(write, limiter.decrementer());
  source.activate();
  graph.wait_for_all();
  if (arrived != cursor.handed_out()) {
    throw std::logic_error("expected " + std::to_string(cursor.handed_out()) +
                           " samples at the writer, got " + std::to_string(arrived));
  }
  return arrived;
}

/// Volumes with kFlagBeyondCalibration, counted by one thread at a time.
class BeyondCalibration {
 public:
  void add(const SampleMessage& message) {
    ++samples_;
    if (!(message.sample.statistics.flags & kFlagBeyondCalibration)) return;
    ++found_;
    if (message.notes.saturated_share <= largest_share_) return;
    largest_share_ = message.notes.saturated_share;
    worst_ = message.sample.sample_id;
  }

  void warn(const std::function<void(const std::string&)>& warn) const {
    if (found_ == 0 || !warn) return;
    warn(
        fmt::format("expected activations within the calibrated range of int8, got {} of {} "
                    "volumes with more than {:g} % of them clipped, the worst with {:.2g} % ({}): "
                    "calibrate again with images like these",
                    found_, samples_, 100 * kMostSaturated, 100 * largest_share_, worst_));
  }

 private:
  std::int64_t samples_ = 0;
  std::int64_t found_ = 0;
  double largest_share_ = 0;
  std::string worst_;
};

}  // namespace

std::vector<const PlannedShard*> run_conversion(const char* name, const ConversionJob& job,
                                                const std::vector<const PlannedShard*>& shards,
                                                SampleSink& sink, SharedFolder* shared) {
  const RunOptions& options = job.options;
  check_pairs_fit(shards, job.generator, memory_limit_bytes());
  const GraphLimits limits =
      graph_limits(shards, job.generator, thread_count(options.threads), memory_limit_bytes());
  const SampleStages stages(job.manifest, job.datasets, job.generator,
                            static_cast<int>(limits.in_flight));
  const auto to_make = sink.closed() ? std::vector<const PlannedShard*>() : shards;
  std::int64_t to_do = 0;                  // samples
  std::atomic<std::int64_t> left_out = 0;  // of those, made by others meanwhile
  for (const PlannedShard* shard : to_make) to_do += std::ssize(shard->samples);
  ShardQueue queue(to_make, [&](const PlannedShard& shard) {
    const ShardActivity activity = shared ? shared->look_at(shard) : ShardActivity::kFree;
    if (activity == ShardActivity::kDone) left_out += std::ssize(shard.samples);
    return activity;
  });
  const std::unique_ptr<Progress> progress =
      options.make_progress && to_do > 0 ? options.make_progress(to_do) : nullptr;

  ShardPace pace(limits.threads);
  const StopMonitor monitor(options.since_stop_request, options.grace_s,
                            [&] { return pace.work_left(); });

  BeyondCalibration beyond_calibration;
  std::vector<const PlannedShard*> made_by_others;  // while they were made here, too
  const auto write = [&](const SampleMessage& message) {
    const PlannedShard& shard = *message.shard;
    const int samples = static_cast<int>(shard.samples.size());
    if (message.slot == 0) {
      sink.open(shard);
      pace.open(samples);
    }
    sink.add(message);
    beyond_calibration.add(message);
    pace.take(std::ssize(message.chunk));
    const bool ends_shard = message.slot + 1 == samples;
    if (ends_shard) {
      pace.begin_commit();
      if (!sink.commit()) made_by_others.push_back(&shard);
      pace.close();
    }
    if (progress) {
      progress->set_total(to_do - left_out);
      progress->advance(message.failed(), std::ssize(message.chunk));
    }
    return !ends_shard || !sink.closed();
  };
  {
    const TraceSpan span(options.trace, name, "job");
    run_conversion_graph(
        [&] { return queue.next([&] { return monitor.order() != StopOrder::kGoOn; }); },
        {[&](SampleMessage& message) { stages.read(message); },
         [&](SampleMessage& message) { stages.generate(message); },
         [&](SampleMessage& message) { stages.finish(message); }, write},
        limits, [&] { return monitor.order(); }, options.trace);
  }
  sink.abandon();
  if (progress) {
    progress->set_total(to_do - left_out);
    progress->finish();
  }
  beyond_calibration.warn(options.warn);
  made_by_others.insert(made_by_others.end(), queue.done_by_others().begin(),
                        queue.done_by_others().end());
  return made_by_others;
}

GraphLimits graph_limits(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                         int threads, std::size_t memory_bytes) {
  std::size_t sample_bytes = 1;
  std::size_t generator_bytes = 1;
  int device_calls = 0;
  for (const PlannedShard* shard : shards) {
    const VolumeShape shape{generator.bins(), shard->volume_size};
    sample_bytes = std::max(sample_bytes, kVolumeCopies * shape.value_count() * sizeof(float));
    generator_bytes = std::max(generator_bytes, generator.working_bytes(shard->volume_size));
    device_calls = std::max(device_calls, generator.device_calls(shard->volume_size));
  }
  const int generators = static_cast<int>(
      std::clamp<std::size_t>(memory_bytes / 4 * 3 / generator_bytes, 1,
                              static_cast<std::size_t>(device_calls > 0 ? device_calls : threads)));
  const int waiting = device_calls > 0 ? generators : 0;
  const auto at_once = static_cast<std::size_t>(threads + waiting);
  const std::size_t in_flight =
      std::clamp(kInFlightBytes / sample_bytes, at_once + 1, 4 * at_once + 4);
  const std::size_t most = std::max<std::size_t>(memory_bytes / 2 / sample_bytes, 1);
  return {threads, std::min(in_flight, most), generators, waiting};
}

void check_pairs_fit(const std::vector<const PlannedShard*>& shards, const Generator& generator,
                     std::size_t memory_bytes) {
  for (const PlannedShard* shard : shards) {
    if (shard->samples.empty()) continue;
    const ImageSize size = shard->volume_size;
    const std::size_t volume_bytes =
        VolumeShape{generator.bins(), size}.value_count() * sizeof(float);
    const std::size_t needed =
        volume_bytes + std::max(generator.working_bytes(size), (kVolumeCopies - 1) * volume_bytes);
    if (needed <= memory_bytes) continue;
    const PlannedSample& sample = shard->samples.front();
    throw std::runtime_error(
        "expected pairs that fit into memory, " + std::to_string(memory_bytes) + " bytes, got " +
        to_string(size) + ", which take about " + std::to_string(needed) + ", in " +
        sample.pair.previous.path + " and " + sample.pair.next.path + " (" + sample.sample_id +
        "): set a smaller $.image.width and height, or use a machine with more memory");
  }
}

std::size_t run_conversion_graph(const std::function<const PlannedShard*()>& next_shard,
                                 const ConversionBodies& bodies, const GraphLimits& limits,
                                 const std::function<StopOrder()>& order, TraceRecorder* trace) {
  const int threads = limits.threads + limits.waiting;
  const oneapi::tbb::global_control budget(oneapi::tbb::global_control::max_allowed_parallelism,
                                           static_cast<std::size_t>(threads));
  oneapi::tbb::task_arena arena(threads);
  return arena.execute([&] { return run_graph(next_shard, bodies, limits, order, trace); });
}

}  // namespace eventgan
