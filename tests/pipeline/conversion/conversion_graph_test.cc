#include "pipeline/conversion/conversion_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>

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

class ConversionGraph : public ::testing::TestWithParam<int> {
 protected:
  GraphLimits limits() const { return {GetParam(), static_cast<std::size_t>(GetParam()) + 1}; }
  const PlannedShard a_ = shard("a", 3), empty_ = shard("e", 0), b_ = shard("b", 40);
  const std::vector<const PlannedShard*> shards_ = {&a_, &empty_, &b_};
};

TEST_P(ConversionGraph, WritesEverySampleInPlanOrderWhateverOrderTheyFinishIn) {
  Recorder recorder;
  ConversionBodies bodies = recorder.bodies();
  std::atomic<unsigned> work = 0;
  bodies.generate = [&](SampleMessage& message) {
    // Early samples take longest, so that with several threads they finish out of order.
    for (unsigned i = 0; i < 20000u / (message.number % 7 + 1); ++i) work += i;
  };
  EXPECT_EQ(run_conversion_graph(shards_, bodies, limits()), 43u);
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
  run_conversion_graph(shards_, bodies, {GetParam(), 3});
  EXPECT_LE(most, 3);
  EXPECT_GE(most, 1);
}

TEST_P(ConversionGraph, AFailedSampleReachesItsSlot) {
  Recorder recorder;
  ConversionBodies bodies = recorder.bodies();
  bodies.read = [](SampleMessage& message) {
    if (message.number % 5 == 2) message.fail("expected a frame, got none");
  };
  EXPECT_EQ(run_conversion_graph(shards_, bodies, limits()), 43u);
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
    EXPECT_THROW(run_conversion_graph(shards_, bodies, limits()), std::runtime_error) << stage;
  }
}

TEST_P(ConversionGraph, StopsWhenTheWriterSaysSo) {
  std::size_t written = 0;
  ConversionBodies bodies = Recorder().bodies();
  bodies.write = [&](SampleMessage&) { return ++written < 5; };
  const std::size_t arrived = run_conversion_graph(shards_, bodies, limits());
  EXPECT_GE(arrived, 5u);
  EXPECT_LE(arrived, 5 + 2 * limits().in_flight);  // what was under way still comes
}

TEST_P(ConversionGraph, OfNothingEndsAtOnce) {
  Recorder recorder;
  EXPECT_EQ(run_conversion_graph({}, recorder.bodies(), limits()), 0u);
  EXPECT_EQ(run_conversion_graph({&empty_}, recorder.bodies(), limits()), 0u);
}

INSTANTIATE_TEST_SUITE_P(Threads, ConversionGraph, ::testing::Values(1, 2, 5));

TEST(SamplesInFlight, KeepsThreadsBusyWithinTheBudget) {
  EXPECT_EQ(samples_in_flight(2, 10, 1000), 12u);   // plenty: 4 x 2 + 4
  EXPECT_EQ(samples_in_flight(2, 100, 1000), 10u);  // the budget
  EXPECT_EQ(samples_in_flight(2, 5000, 1000), 3u);  // never fewer than threads + 1
  EXPECT_EQ(samples_in_flight(1, 0, 1000), 8u);
}

}  // namespace
}  // namespace eventgan
