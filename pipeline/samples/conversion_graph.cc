#include "pipeline/samples/conversion_graph.h"

#include <oneapi/tbb/flow_graph.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <stdexcept>
#include <string>

#include "pipeline/samples/sample_span.h"

namespace eventgan {
namespace {

namespace flow = oneapi::tbb::flow;
using Message = std::shared_ptr<SampleMessage>;

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
    auto message = std::make_shared<SampleMessage>();
    message->number = number_++;
    message->shard = shard_;
    message->slot = static_cast<int>(slot_++);
    return message;
  }

  std::size_t handed_out() const { return number_; }

 private:
  const std::function<const PlannedShard*()>& next_shard_;
  const PlannedShard* shard_ = nullptr;
  std::size_t slot_ = 0;
  std::size_t number_ = 0;
};

std::size_t run(const std::function<const PlannedShard*()>& next_shard,
                const ConversionBodies& bodies, const GraphLimits& limits,
                const std::function<StopOrder()>& order, TraceRecorder* trace) {
  flow::graph graph;
  Cursor cursor(next_shard);
  std::atomic<bool> stop = false;
  std::atomic<const PlannedShard*> at_writer = nullptr;
  std::size_t arrived = 0;  // touched by the serial writer alone

  flow::input_node<Message> source(graph, [&](oneapi::tbb::flow_control& control) -> Message {
    Message message = stop ? nullptr : cursor.next(order(), at_writer);
    if (!message) control.stop();
    if (message && trace) ++trace->gauges().samples_in_flight;
    return message;
  });
  flow::limiter_node<Message> limiter(graph, limits.in_flight);
  const auto parallel = [&](Stage stage, int at_once,
                            const std::function<void(SampleMessage&)>& body) {
    return flow::function_node<Message, Message>(graph, static_cast<std::size_t>(at_once),
                                                 [&body, &order, stage, trace](Message message) {
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
  flow::function_node<Message, flow::continue_msg> write(graph, flow::serial, [&](Message message) {
    ++arrived;
    at_writer = message->shard;
    const SampleSpan span(trace, Stage::kWrite, *message);
    if (!bodies.write(*message)) stop = true;
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

}  // namespace

std::size_t samples_in_flight(int threads, std::size_t sample_bytes, std::size_t budget_bytes) {
  const auto least = static_cast<std::size_t>(threads) + 1;
  const std::size_t enough = 4 * static_cast<std::size_t>(threads) + 4;
  return std::clamp(budget_bytes / std::max<std::size_t>(sample_bytes, 1), least, enough);
}

std::size_t run_conversion_graph(const std::function<const PlannedShard*()>& next_shard,
                                 const ConversionBodies& bodies, const GraphLimits& limits,
                                 const std::function<StopOrder()>& order, TraceRecorder* trace) {
  const oneapi::tbb::global_control budget(oneapi::tbb::global_control::max_allowed_parallelism,
                                           static_cast<std::size_t>(limits.threads));
  oneapi::tbb::task_arena arena(limits.threads);
  return arena.execute([&] { return run(next_shard, bodies, limits, order, trace); });
}

}  // namespace eventgan
