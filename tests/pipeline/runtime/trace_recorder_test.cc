#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <map>
#include <set>
#include <stdexcept>
#include <thread>

#include "pipeline/runtime/trace.h"
#include "tests/pipeline/runtime/trace_reading.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/texts.h"

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
  EXPECT_THROWS(
      {
        const TraceSpan span(&trace_, "a", "c");
        throw std::runtime_error("disk full");
      },
      std::runtime_error, "disk full");
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

class Recorder : public ::testing::Test {
 protected:
  testing::TemporaryFolder folder_;
  const std::filesystem::path file_ = folder_ / "t.json";
};

TEST_F(Recorder, OfAnEmptyRunNamesTheProcess) {
  TraceRecorder trace(file_, {{"program", "p \"1\""}});
  trace.finish();
  const auto json = read_trace(file_);
  EXPECT_EQ(json.at("displayTimeUnit"), "ms");
  EXPECT_EQ(json.at("otherData").at("program"), "p \"1\"");
  EXPECT_THAT(json.at("otherData").at("started_at").get<std::string>(),
              ::testing::MatchesRegex("20..-..-..T..:..:..Z"));
  ASSERT_EQ(json.at("traceEvents").size(), 1u);
  EXPECT_EQ(json.at("traceEvents")[0].at("args").at("name"), "eventgan");
  EXPECT_EQ(json.at("traceEvents")[0].at("pid"), getpid());
}

TEST_F(Recorder, WritesWorkAsItIsTold) {
  TraceRecorder trace(file_, {});
  trace.add({"n\"1", "c", 1'000, 2'001, 5, 1'999, "\"k\":1"});
  trace.finish();
  const auto work = events(read_trace(file_), "X");
  ASSERT_EQ(work.size(), 1u);
  EXPECT_EQ(work[0], nlohmann::json({{"ph", "X"},
                                     {"name", "n\"1"},
                                     {"cat", "c"},
                                     {"ts", 1.0},
                                     {"dur", 2.001},
                                     {"tts", 0.005},
                                     {"tdur", 1.999},
                                     {"pid", getpid()},
                                     {"tid", gettid()},
                                     {"args", {{"k", 1}}}}));
}

TEST_F(Recorder, WritesCounters) {
  TraceRecorder trace(file_, {});
  trace.add_counter("memory", "MB", 1.5);
  trace.finish();
  const auto counters = events(read_trace(file_), "C", "memory");
  ASSERT_EQ(counters.size(), 1u);
  EXPECT_EQ(counters[0].at("args"), nlohmann::json({{"MB", 1.5}}));
  EXPECT_EQ(events(read_trace(file_), "M").size(), 1u);  // whoever counts is no worker
}

TEST_F(Recorder, NamesThreadsOnceAndTheMainOneMain) {
  TraceRecorder trace(file_, {});
  for (int i = 0; i < 3; ++i) trace.add({"a", "c", i, 1, 0, 0, ""});
  for (int i = 0; i < 2; ++i) std::jthread([&] { trace.add({"b", "c", 9, 1, 0, 0, ""}); });
  trace.finish();
  std::vector<std::string> names;
  for (const auto& event : events(read_trace(file_), "M", "thread_name"))
    names.push_back(event.at("args").at("name"));
  EXPECT_THAT(names, ::testing::UnorderedElementsAre("main", "worker 1", "worker 2"));
}

TEST_F(Recorder, KeepsEveryEventOfManyThreadsBeyondItsBuffers) {
  constexpr int kThreads = 8, kEach = 3'000;  // some 100 bytes each: four buffers and more
  TraceRecorder trace(file_, {});
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < kThreads; ++t) {
      threads.emplace_back([&trace, t] {
        for (int i = 0; i < kEach; ++i) {
          TraceSpan span(&trace, "work", "c");
          span.note("thread", t);
          span.note("number", i);
        }
      });
    }
  }
  EXPECT_FALSE(std::filesystem::exists(file_));
  trace.finish();
  std::map<int, std::set<int>> numbers;
  std::map<int, std::set<int>> tids;
  for (const auto& event : events(read_trace(file_), "X")) {
    const int thread = event.at("args").at("thread");
    numbers[thread].insert(event.at("args").at("number").get<int>());
    tids[thread].insert(event.at("tid").get<int>());
  }
  ASSERT_EQ(numbers.size(), std::size_t{kThreads});
  for (const auto& [thread, of_thread] : numbers) EXPECT_EQ(of_thread.size(), std::size_t{kEach});
  for (const auto& [thread, of_thread] : tids) EXPECT_EQ(of_thread.size(), 1u);
}

TEST_F(Recorder, StreamsWhileItRuns) {
  TraceRecorder trace(file_, {});
  const std::string note = "\"text\":\"" + std::string(1000, 'x') + "\"";
  for (int i = 0; i < 200; ++i) trace.add({"a", "c", i, 1, 0, 0, note});
  const auto names = testing::names_in(folder_.path());
  ASSERT_EQ(names.size(), 1u);  // the temporary one
  EXPECT_GE(std::filesystem::file_size(folder_ / names[0]), 128'000u);
}

TEST_F(Recorder, AnEventLargerThanItsBufferIsWhole) {
  TraceRecorder trace(file_, {});
  const std::string note = "\"text\":\"" + std::string(200'000, 'x') + "\"";
  trace.add({"a", "c", 0, 1, 0, 0, note});
  trace.finish();
  EXPECT_EQ(events(read_trace(file_), "X").size(), 1u);
}

TEST_F(Recorder, TwoOneAfterTheOtherDoNotMix) {
  for (const char* name : {"first", "second"}) {
    TraceRecorder trace(file_, {});
    trace.add({name, "c", 0, 1, 0, 0, ""});
    trace.finish();
    EXPECT_EQ(events(read_trace(file_), "X").size(), 1u);
    EXPECT_EQ(events(read_trace(file_), "X", name).size(), 1u);
  }
}

TEST_F(Recorder, AFullDiskEndsTheTraceAndNothingElse) {
  const std::string error = testing::error_on_full_disk(100'000, [&] {
    TraceRecorder trace(file_, {});
    const std::string note = "\"text\":\"" + std::string(1000, 'x') + "\"";
    for (int i = 0; i < 400; ++i) trace.add({"a", "c", i, 1, 0, 0, note});
    if (!testing::names_in(folder_.path()).empty()) throw std::runtime_error("it keeps its space");
    trace.finish();
  });
  EXPECT_THAT(error, ::testing::HasSubstr(file_.string()));
  EXPECT_THAT(testing::names_in(folder_.path()), ::testing::IsEmpty());
}

TEST_F(Recorder, WithoutAnEndNothingIsLeft) {
  { TraceRecorder(file_, {}).add({"a", "c", 0, 1, 0, 0, ""}); }
  EXPECT_THAT(testing::names_in(folder_.path()), ::testing::IsEmpty());
}

}  // namespace
}  // namespace eventgan
