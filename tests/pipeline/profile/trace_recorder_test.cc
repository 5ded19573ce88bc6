#include "pipeline/profile/trace_recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <map>
#include <set>
#include <thread>

#include "pipeline/profile/trace_span.h"
#include "tests/pipeline/profile/trace_reading.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using testing::events;
using testing::read_trace;

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
