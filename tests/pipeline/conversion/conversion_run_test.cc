#include "pipeline/conversion/conversion_run.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <deque>
#include <map>
#include <mutex>
#include <stdexcept>
#include <thread>

#include "tests/pipeline/runtime/trace_reading.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

PlannedShard shard(const std::string& name, int samples) {
  PlannedShard result{name, 0, {1, 1}, {}};
  result.samples.resize(static_cast<std::size_t>(samples));
  return result;
}

/// Bodies that do nothing but record what the writer got.
struct Recorder {
  std::vector<std::string> written;
  std::vector<bool> failed;

  ConversionBodies bodies() {
    return {[](SampleMessage&) {}, [](SampleMessage&) {}, [](SampleMessage&) {},
            [this](SampleMessage& message) {
              written.push_back(message.shard->name + std::to_string(message.slot));
              failed.push_back(message.failed());
              return true;
            }};
  }
};

/// Gives the shards one after the other, then nullptr for ever.
std::function<const PlannedShard*()> one_by_one(std::deque<const PlannedShard*> shards) {
  return [shards]() mutable -> const PlannedShard* {
    if (shards.empty()) return nullptr;
    const PlannedShard* const next = shards.front();
    shards.pop_front();
    return next;
  };
}

StopOrder go_on() { return StopOrder::kGoOn; }

class ConversionGraph : public ::testing::TestWithParam<int> {
 protected:
  GraphLimits limits() const {
    return {GetParam(), static_cast<std::size_t>(GetParam()) + 1, GetParam()};
  }

  /// Of the shards a, e and b. The same number of samples must leave the source and arrive.
  std::size_t run(const ConversionBodies& bodies,
                  const std::function<StopOrder()>& order = go_on) const {
    return run_conversion_graph(one_by_one({&a_, &empty_, &b_}), bodies, limits(), order);
  }

  const PlannedShard a_ = shard("a", 3), empty_ = shard("e", 0), b_ = shard("b", 40);
};

TEST_P(ConversionGraph, WritesEverySampleInPlanOrderWhateverOrderTheyFinishIn) {
  Recorder recorder;
  ConversionBodies bodies = recorder.bodies();
  std::atomic<unsigned> work = 0;
  bodies.generate = [&](SampleMessage& message) {
    // Early samples take longest, so that with several threads they finish out of order.
    for (unsigned i = 0; i < 20000u / (message.number % 7 + 1); ++i) work += i;
  };
  EXPECT_EQ(run(bodies), 43u);
  std::vector<std::string> expected;
  for (int slot = 0; slot < 3; ++slot) expected.push_back("a" + std::to_string(slot));
  for (int slot = 0; slot < 40; ++slot) expected.push_back("b" + std::to_string(slot));
  EXPECT_EQ(recorder.written, expected);
}

TEST_P(ConversionGraph, NeverHasMoreSamplesUnderWayThanTheLimit) {
  Recorder recorder;
  ConversionBodies bodies = recorder.bodies();
  std::atomic<int> under_way = 0, most = 0;
  bodies.read = [&](SampleMessage&) {
    const int now = ++under_way;
    int seen = most;
    while (seen < now && !most.compare_exchange_weak(seen, now)) {
    }
  };
  const auto write = bodies.write;
  bodies.write = [&](SampleMessage& message) {
    --under_way;
    return write(message);
  };
  run_conversion_graph(one_by_one({&a_, &b_}), bodies, {GetParam(), 3}, go_on);
  EXPECT_LE(most, 3);
  EXPECT_GE(most, 1);
}

TEST_P(ConversionGraph, AFailedSampleReachesItsSlot) {
  Recorder recorder;
  ConversionBodies bodies = recorder.bodies();
  bodies.read = [](SampleMessage& message) {
    if (message.number % 5 == 2) message.fail("expected a frame, got none");
  };
  EXPECT_EQ(run(bodies), 43u);
  for (std::size_t i = 0; i < recorder.failed.size(); ++i)
    EXPECT_EQ(recorder.failed[i], i % 5 == 2);
}

TEST_P(ConversionGraph, AnExceptionOfABodyEndsTheRun) {
  for (int stage = 0; stage < 4; ++stage) {
    Recorder recorder;
    ConversionBodies bodies = recorder.bodies();
    const auto fail = [](SampleMessage& message) {
      if (message.number == 10) throw std::runtime_error("disk full");
    };
    if (stage == 0) bodies.read = fail;
    if (stage == 1) bodies.generate = fail;
    if (stage == 2) bodies.finish = fail;
    if (stage == 3) bodies.write = [&](SampleMessage& message) { return fail(message), true; };
    EXPECT_THROWS(run(bodies), std::runtime_error, "disk full") << stage;
  }
}

TEST_P(ConversionGraph, StopsWhenTheWriterSaysSo) {
  std::size_t written = 0;
  ConversionBodies bodies = Recorder().bodies();
  bodies.write = [&](SampleMessage&) { return ++written < 5; };
  const std::size_t arrived = run(bodies);
  EXPECT_EQ(written, 5u);
  EXPECT_GE(arrived, 5u);
  EXPECT_LE(arrived, 5 + 2 * limits().in_flight);  // what was under way still comes
}

TEST_P(ConversionGraph, OfNothingEndsAtOnce) {
  Recorder recorder;
  for (const auto& shards : {std::deque<const PlannedShard*>{}, {&empty_}}) {
    const std::size_t arrived =
        run_conversion_graph(one_by_one(shards), recorder.bodies(), limits(), go_on);
    EXPECT_EQ(arrived, 0u);
  }
}

TEST_P(ConversionGraph, AnExceptionOfTheSourceEndsTheRun) {
  Recorder recorder;
  int calls = 0;
  const auto fail = [&]() -> const PlannedShard* {
    if (++calls == 2) throw std::runtime_error("cannot list");
    return &a_;
  };
  EXPECT_THROWS(run_conversion_graph(fail, recorder.bodies(), limits(), go_on), std::runtime_error,
                "cannot list");
}

TEST_P(ConversionGraph, AsksForAShardOnlyWhenTheOneBeforeIsUnderWay) {
  Recorder recorder;
  std::atomic<int> read = 0;
  std::vector<int> seen;
  const PlannedShard long_shard = shard("l", 100);
  std::deque<const PlannedShard*> shards = {&long_shard, &a_};
  ConversionBodies bodies = recorder.bodies();
  bodies.read = [&](SampleMessage&) { ++read; };
  const auto next = [&]() -> const PlannedShard* {
    seen.push_back(read);
    if (shards.empty()) return nullptr;
    const PlannedShard* const front = shards.front();
    shards.pop_front();
    return front;
  };
  run_conversion_graph(next, bodies, limits(), go_on);
  ASSERT_EQ(seen.size(), 3u);
  EXPECT_EQ(seen[0], 0);
  EXPECT_GE(seen[1] + static_cast<int>(limits().in_flight), 100);
}

TEST_P(ConversionGraph, FinishingAShardGivesItWholeAndNoOther) {
  Recorder recorder;
  std::atomic<StopOrder> order = StopOrder::kGoOn;
  ConversionBodies bodies = recorder.bodies();
  const auto write = bodies.write;
  bodies.write = [&](SampleMessage& message) {
    if (message.shard == &b_) order = StopOrder::kFinishShard;
    return write(message);
  };
  const PlannedShard more = shard("m", 1000);
  const std::size_t arrived = run_conversion_graph(one_by_one({&a_, &b_, &more}), bodies, limits(),
                                                   [&] { return order.load(); });
  EXPECT_EQ(arrived, 43u);
}

TEST_P(ConversionGraph, FinishingAShardLeavesAlmostNothingOfTheNextAndWritesNoneOfIt) {
  Recorder recorder;
  std::atomic<StopOrder> order = StopOrder::kGoOn;
  ConversionBodies bodies = recorder.bodies();
  const auto write = bodies.write;
  bodies.write = [&](SampleMessage& message) {
    if (message.shard == &a_) order = StopOrder::kFinishShard;
    return write(message);
  };
  EXPECT_LE(run(bodies, [&] { return order.load(); }), 3 + 2 * limits().in_flight);
  EXPECT_THAT(recorder.written, ::testing::ElementsAre("a0", "a1", "a2"));
}

TEST_P(ConversionGraph, AnAbortWritesNothingMore) {
  Recorder recorder;
  std::atomic<StopOrder> order = StopOrder::kGoOn;
  ConversionBodies bodies = recorder.bodies();
  const auto write = bodies.write;
  bodies.write = [&](SampleMessage& message) {
    if (message.number == 4) order = StopOrder::kAbort;
    return write(message);
  };
  run(bodies, [&] { return order.load(); });
  EXPECT_THAT(recorder.written, ::testing::ElementsAre("a0", "a1", "a2", "b0", "b1"));
}

TEST_P(ConversionGraph, AnAbortLetsMessagesPassWithoutWork) {
  Recorder recorder;
  std::atomic<StopOrder> order = StopOrder::kGoOn;
  std::atomic<std::size_t> late = 0;
  ConversionBodies bodies = recorder.bodies();
  bodies.generate = [&](SampleMessage& message) {
    if (message.number == 10) order = StopOrder::kAbort;
  };
  bodies.finish = [&](SampleMessage& message) { late += message.number >= 10; };
  const std::size_t arrived = run(bodies, [&] { return order.load(); });
  EXPECT_GE(arrived, 11u);  // in order, so all before it too
  EXPECT_LE(arrived, 10 + 2 * limits().in_flight);
  EXPECT_LE(late, limits().in_flight);  // those that had overtaken it
}

TEST_P(ConversionGraph, AnAbortBeforeTheStartDoesNothing) {
  Recorder recorder;
  EXPECT_EQ(run(recorder.bodies(), [] { return StopOrder::kAbort; }), 0u);
}

TEST_P(ConversionGraph, TracesEachStageOfEachSample) {
  const testing::TemporaryFolder folder;
  TraceRecorder trace(folder / "t.json", {});
  ConversionBodies bodies = Recorder().bodies();
  int most = 0;
  bodies.read = [](SampleMessage& message) {
    if (message.slot == 1) message.fail("expected a frame, got none");
  };
  bodies.finish = [&](SampleMessage& message) {
    EXPECT_GE(trace.gauges().samples_at_work, 1);
    message.chunk.resize(7);
  };
  bodies.write = [&](SampleMessage&) {
    most = std::max(most, trace.gauges().samples_in_flight.load());
    return true;
  };
  PlannedShard traced = shard("s.h5", 20);
  traced.volume_size = {2, 3};
  for (std::size_t i = 0; i < 20; ++i) traced.samples[i].sample_id = "id" + std::to_string(i);
  run_conversion_graph(one_by_one({&traced}), bodies, limits(), go_on, &trace);
  EXPECT_GE(most, 1);
  EXPECT_EQ(trace.gauges().samples_in_flight, 0);
  EXPECT_EQ(trace.gauges().samples_at_work, 0);
  trace.finish();
  const nlohmann::json json = testing::read_trace(folder / "t.json");
  std::map<std::string, int> count;
  for (const auto& event : testing::events(json, "X")) ++count[event.at("name")];
  EXPECT_EQ(count, (std::map<std::string, int>{
                       {"read", 20}, {"generate", 20}, {"finish", 20}, {"write", 20}}));
  const auto arguments = [&](const char* stage, int slot) -> nlohmann::json {
    for (const auto& event : testing::events(json, "X", stage)) {
      if (event.at("args").at("slot") == slot) return event.at("args");
    }
    return {};
  };
  nlohmann::json finish = arguments("finish", 4);
  EXPECT_GE(finish.at("waited_us"), 0);
  finish.erase("waited_us");
  EXPECT_EQ(finish,
            nlohmann::json(
                {{"sample", "id4"}, {"shard", "s.h5"}, {"slot", 4}, {"pixels", 6}, {"bytes", 7}}));
  EXPECT_FALSE(arguments("read", 4).contains("waited_us"));
  // A fault is noted in the stage in which it arose.
  EXPECT_THAT(arguments("read", 1).at("fault").get<std::string>(),
              ::testing::StartsWith("expected a frame, got none"));
  EXPECT_FALSE(arguments("generate", 1).contains("fault"));
}

INSTANTIATE_TEST_SUITE_P(Threads, ConversionGraph, ::testing::Values(1, 2, 5));

#ifdef __SANITIZE_THREAD__
/// What is not built for the sanitizer must not hide it.
TEST(ConversionGraphUnderTheSanitizer, FindsARaceOfTheBodies) {
  const auto race = [] {
    const PlannedShard two = shard("s", 2);
    std::atomic<int> here = 0;
    // By itself: of eight bytes the sanitizer remembers four accesses, and waiting is many.
    alignas(64) int shared = 0;
    Recorder recorder;
    ConversionBodies bodies = recorder.bodies();
    bodies.generate = [&](SampleMessage&) {
      here.fetch_add(1, std::memory_order_relaxed);
      while (here.load(std::memory_order_relaxed) < 2) std::this_thread::yield();
      ++shared;
    };
    run_conversion_graph(one_by_one({&two}), bodies, {2, 3, 2}, go_on);
    std::exit(0);
  };
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(race(), ::testing::ExitedWithCode(66), "ThreadSanitizer: data race");
}
#endif

constexpr std::size_t kMuch = std::size_t{1} << 50;
const testing::FakeGenerator kGenerator;

/// Needs a kilobyte for each pixel.
class LargeGenerator final : public Generator {
 public:
  explicit LargeGenerator(int device_calls = 0) : device_calls_(device_calls) {}
  int bins() const override { return 9; }
  GenerationNotes generate(const GeneratorInput&, std::span<float>) const override { return {}; }
  std::string description() const override { return "large"; }
  std::size_t working_bytes(ImageSize size) const override { return 1024 * size.pixel_count(); }
  int device_calls(ImageSize) const override { return device_calls_; }

 private:
  int device_calls_;
};

TEST(GraphLimits, KeepThreadsBusyWithSmallSamples) {
  const PlannedShard small{"s.h5", 0, {20, 30}, {}};
  const GraphLimits limits = graph_limits({&small}, kGenerator, 3, kMuch);
  EXPECT_EQ(limits.threads, 3);
  EXPECT_EQ(limits.in_flight, 16u);  // four for each thread and four more
  EXPECT_EQ(graph_limits({}, kGenerator, 3, kMuch).in_flight, 16u);
}

TEST(GraphLimits, HoldNoMoreOfTheLargestThanMemoryHas) {
  const PlannedShard small{"s.h5", 0, {20, 30}, {}};
  // 18 channels of 1024 x 1024 float32, twice: 144 MiB, so seven in a gibibyte.
  const PlannedShard large{"l.h5", 0, {1024, 1024}, {}};
  EXPECT_EQ(graph_limits({&small, &large, &small}, kGenerator, 1, kMuch).in_flight, 7u);
  EXPECT_EQ(graph_limits({&large}, kGenerator, 8, kMuch).in_flight,
            9u);  // never fewer than threads + 1
  // 144 MiB each (see above): seven in a gibibyte.
  const std::size_t gibibyte = std::size_t{1} << 30;
  EXPECT_EQ(graph_limits({&large}, kGenerator, 8, 2 * gibibyte).in_flight, 7u);
  EXPECT_EQ(graph_limits({&large}, kGenerator, 8, 1000).in_flight, 1u);
}

TEST(GraphLimits, RunNoMoreGeneratorsAtOnceThanFitIntoThreeQuartersOfTheMemory) {
  const PlannedShard small{"s.h5", 0, {32, 32}, {}};
  const PlannedShard large{"l.h5", 0, {1024, 1024}, {}};
  const std::size_t gibibyte = std::size_t{1} << 30;
  const LargeGenerator generator;
  EXPECT_EQ(graph_limits({&small}, generator, 64, 8 * gibibyte).generators, 64);
  EXPECT_EQ(graph_limits({&small, &large}, generator, 64, 8 * gibibyte).generators, 6);
  EXPECT_EQ(graph_limits({&large}, generator, 64, gibibyte).generators, 1);  // one always
  EXPECT_EQ(graph_limits({&large}, kGenerator, 64, gibibyte).generators, 64);
  EXPECT_EQ(graph_limits({}, generator, 64, 0).generators, 1);
}

TEST(GraphLimits, GiveCallsThatWaitForADeviceThreadsOfTheirOwn) {
  const PlannedShard small{"s.h5", 0, {20, 30}, {}};
  const LargeGenerator generator(/*device_calls=*/4);
  const GraphLimits limits = graph_limits({&small}, generator, 2, kMuch);
  EXPECT_EQ(limits.threads, 2);
  EXPECT_EQ(limits.generators, 4);
  EXPECT_EQ(limits.waiting, 4);
  EXPECT_EQ(limits.in_flight, 4 * (2 + 4) + 4u);
  EXPECT_EQ(graph_limits({&small}, kGenerator, 2, kMuch).waiting, 0);
  // 1024 x 1024 pixels with a kilobyte each: two in three quarters of 3 GiB.
  const PlannedShard large{"l.h5", 0, {1024, 1024}, {}};
  EXPECT_EQ(graph_limits({&large}, generator, 2, std::size_t{3} << 30).generators, 2);
}

TEST(ConversionGraphOnADevice, ReadsOnWhileAllItsCallsWait) {
  constexpr int kWaiting = 4;
  const PlannedShard shards = shard("s", 40);
  Recorder recorder;
  ConversionBodies bodies = recorder.bodies();
  std::mutex mutex;
  std::condition_variable changed;
  int read = 0, waiting = 0;
  bool filled = false;
  bodies.read = [&](SampleMessage&) {
    const std::lock_guard lock(mutex);
    ++read;
    changed.notify_all();
  };
  bodies.generate = [&](SampleMessage&) {  // until all calls wait and as many more are read
    std::unique_lock lock(mutex);
    ++waiting;
    changed.notify_all();
    EXPECT_TRUE(changed.wait_for(lock, std::chrono::seconds(20), [&] {
      return filled = filled || (waiting == kWaiting && read == 2 * kWaiting);
    }));
    --waiting;
  };
  const GraphLimits limits{1, 2 * kWaiting, kWaiting, kWaiting};
  EXPECT_EQ(run_conversion_graph(one_by_one({&shards}), bodies, limits, go_on), 40u);
  EXPECT_TRUE(filled);
}

TEST(CheckPairsFit, NamesThePairThatDoesNot) {
  const PlannedSample sample{"id7", "", "", {{"a.png"}, {"b.png"}}, ""};
  const PlannedShard small{"s.h5", 0, {32, 32}, {sample}};
  const PlannedShard large{"l.h5", 0, {1024, 512}, {sample}};
  const LargeGenerator generator;
  // 1024 x 512 pixels with a kilobyte of working memory and a volume of 18 x 4 bytes each.
  const std::size_t needed = std::size_t{1024} * 512 * (1024 + 18 * 4);
  check_pairs_fit({&small, &large}, generator, needed);
  EXPECT_THROWS(check_pairs_fit({&small, &large}, generator, needed - 1), std::runtime_error,
                std::to_string(needed - 1) + " bytes, got 512x1024",
                "about " + std::to_string(needed), "in a.png and b.png (id7)");
}

}  // namespace
}  // namespace eventgan
