#include "pipeline/profile/trace_span.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <thread>

#include "tests/pipeline/profile/trace_reading.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using testing::events;
using testing::nanoseconds;
using testing::read_trace;

class Span : public ::testing::Test {
 protected:
  nlohmann::json finished() {
    trace_.finish();
    return read_trace(file_);
  }

  testing::TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_ / "t.json";
  TraceRecorder trace_{file_, {}};
};

TEST_F(Span, NestsInTheOneAround) {
  {
    const TraceSpan outer(&trace_, "outer", "c");
    for (int i = 0; i < 3; ++i) const TraceSpan inner(&trace_, "inner", "c");
  }
  const auto json = finished();
  const auto outer = events(json, "X", "outer").at(0);
  const std::int64_t begin = nanoseconds(outer, "ts");
  const std::int64_t end = begin + nanoseconds(outer, "dur");
  std::int64_t free_from = begin;
  const auto inner = events(json, "X", "inner");
  ASSERT_EQ(inner.size(), 3u);
  for (const auto& span : inner) {
    EXPECT_GE(nanoseconds(span, "ts"), free_from);
    free_from = nanoseconds(span, "ts") + nanoseconds(span, "dur");
  }
  EXPECT_LE(free_from, end);
}

TEST_F(Span, TellsProcessorTimeFromWaiting) {
  {
    const TraceSpan span(&trace_, "sleep", "c");
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const auto span = events(finished(), "X").at(0);
  EXPECT_GE(nanoseconds(span, "dur"), 20'000'000);
  EXPECT_LT(nanoseconds(span, "tdur"), nanoseconds(span, "dur") / 2);
}

TEST_F(Span, NotesWhatItIsTold) {
  {
    TraceSpan span(&trace_, "a", "c");
    span.note("text", "say \"x\"\n");
    span.note("number", -3);
  }
  EXPECT_EQ(events(finished(), "X").at(0).at("args"),
            nlohmann::json({{"text", "say \"x\"\n"}, {"number", -3}}));
}

TEST_F(Span, IsRecordedWhenAnExceptionEndsIt) {
  EXPECT_THROW(
      {
        const TraceSpan span(&trace_, "a", "c");
        throw std::runtime_error("disk full");
      },
      std::runtime_error);
  EXPECT_EQ(events(finished(), "X", "a").size(), 1u);
}

TEST_F(Span, WithoutARecorderDoesNothing) {
  {
    TraceSpan span(nullptr, "a", "c");
    span.note("text", "x");
    span.note("number", 1);
    const TraceSpan recorded(&trace_, "b", "c");
  }
  // Neither an event nor a note of it, though this thread has a recorder.
  const auto spans = events(finished(), "X");
  ASSERT_EQ(spans.size(), 1u);
  EXPECT_EQ(spans[0].at("name"), "b");
  EXPECT_TRUE(spans[0].at("args").empty());
}

}  // namespace
}  // namespace eventgan
