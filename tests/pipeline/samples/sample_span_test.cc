#include "pipeline/samples/sample_span.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <utility>

#include "pipeline/samples/conversion_graph.h"
#include "tests/pipeline/profile/trace_reading.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using testing::events;

PlannedShard shard_of(int samples) {
  PlannedShard shard{"s.h5", 0, {2, 3}, {}};
  shard.samples.resize(static_cast<std::size_t>(samples));
  for (int i = 0; i < samples; ++i) {
    shard.samples[static_cast<std::size_t>(i)].sample_id = "id" + std::to_string(i);
  }
  return shard;
}

class SampleSpanTest : public ::testing::Test {
 protected:
  nlohmann::json finished() {
    trace_.finish();
    return testing::read_trace(file_);
  }

  testing::TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_ / "t.json";
  TraceRecorder trace_{file_, {}};
  const PlannedShard shard_ = shard_of(20);
};

TEST_F(SampleSpanTest, SaysWhichSampleAndWhatBecameOfIt) {
  SampleMessage message;
  message.shard = &shard_;
  message.slot = 4;
  {
    const SampleSpan span(&trace_, Stage::kFinish, message);
    EXPECT_EQ(trace_.gauges().samples_at_work, 1);
    message.chunk.resize(7);
  }
  EXPECT_EQ(trace_.gauges().samples_at_work, 0);
  { const SampleSpan span(&trace_, Stage::kWrite, message); }
  const auto json = finished();
  EXPECT_EQ(events(json, "X", "finish").at(0).at("args"),
            nlohmann::json(
                {{"sample", "id4"}, {"shard", "s.h5"}, {"slot", 4}, {"pixels", 6}, {"bytes", 7}}));
  EXPECT_GE(events(json, "X", "write").at(0).at("args").at("waited_us"), 0);
}

TEST_F(SampleSpanTest, NotesAFaultInTheStageInWhichItArose) {
  SampleMessage message;
  message.shard = &shard_;
  {
    const SampleSpan span(&trace_, Stage::kRead, message);
    message.fail("expected a frame, got none");
  }
  { const SampleSpan span(&trace_, Stage::kGenerate, message); }
  const auto json = finished();
  EXPECT_THAT(events(json, "X", "read").at(0).at("args").at("fault").get<std::string>(),
              ::testing::StartsWith("expected a frame, got none"));
  EXPECT_FALSE(events(json, "X", "generate").at(0).at("args").contains("fault"));
}

TEST_F(SampleSpanTest, TheGraphRecordsEachStageOfEachSample) {
  const PlannedShard* next = &shard_;
  const auto nothing = [](SampleMessage&) {};
  int most = 0;
  run_conversion_graph([&] { return std::exchange(next, nullptr); },
                       {nothing, nothing, nothing,
                        [&](SampleMessage&) {
                          most = std::max(most, trace_.gauges().samples_in_flight.load());
                          return true;
                        }},
                       {3, 5}, [] { return StopOrder::kGoOn; }, &trace_);
  EXPECT_GE(most, 1);
  EXPECT_EQ(trace_.gauges().samples_in_flight, 0);
  EXPECT_EQ(trace_.gauges().samples_at_work, 0);
  std::map<std::string, int> count;
  for (const auto& event : events(finished(), "X")) ++count[event.at("name")];
  EXPECT_EQ(count, (std::map<std::string, int>{
                       {"read", 20}, {"generate", 20}, {"finish", 20}, {"write", 20}}));
}

}  // namespace
}  // namespace eventgan
