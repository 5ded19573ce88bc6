#include "pipeline/profile/trace_watch.h"

#include <gtest/gtest.h>

#include "tests/pipeline/profile/trace_reading.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using testing::events;

TEST(TraceWatch, LooksAtTheStartAndAtTheEndHoweverShortTheRun) {
  const testing::TemporaryFolder folder;
  TraceRecorder trace(folder / "t.json", {});
  trace.gauges().samples_in_flight = 3;
  trace.gauges().samples_at_work = 2;
  { const TraceWatch watch(trace, std::chrono::hours(1)); }
  trace.finish();
  const auto json = testing::read_trace(folder / "t.json");
  for (const char* name : {"resident memory", "samples in flight", "samples at work"}) {
    EXPECT_EQ(events(json, "C", name).size(), 2u) << name;
  }
  EXPECT_EQ(events(json, "C", "samples in flight").back().at("args").at("samples"), 3);
  EXPECT_EQ(events(json, "C", "samples at work").back().at("args").at("samples"), 2);
  EXPECT_GT(events(json, "C", "resident memory").back().at("args").at("MB"), 1);
}

TEST(TraceWatch, LooksNowAndThen) {
  const testing::TemporaryFolder folder;
  TraceRecorder trace(folder / "t.json", {});
  {
    // Once its buffer has gone into the temporary file, it has looked a hundred times and more.
    const TraceWatch watch(trace, std::chrono::milliseconds(1));
    const auto temporary = folder / testing::names_in(folder.path()).at(0);
    while (std::filesystem::file_size(temporary) < 10'000) std::this_thread::yield();
  }
  trace.finish();
  const auto json = testing::read_trace(folder / "t.json");
  EXPECT_GT(events(json, "C", "resident memory").size(), 100u);
  const auto rates = events(json, "C", "processor");
  ASSERT_FALSE(rates.empty());
  for (const auto& rate : rates) EXPECT_GE(rate.at("args").at("cores at work"), 0);
}

}  // namespace
}  // namespace eventgan
