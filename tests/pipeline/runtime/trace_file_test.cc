#include "pipeline/runtime/trace_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "manifests/values/faults.h"
#include "pipeline/runtime/trace.h"
#include "tests/pipeline/runtime/trace_reading.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using testing::events;
using ::testing::IsEmpty;
using testing::names_in;

TEST(TraceString, IsAJsonStringOfTheText) {
  for (const std::string text : {"", "plain", "a\"b\\c\n\t\x01", "Zürich 東京"}) {
    EXPECT_EQ(nlohmann::json::parse(trace_string(text)), text);
  }
  EXPECT_EQ(nlohmann::json::parse(trace_string("\xff")), "\xEF\xBF\xBD");
}

TEST(TraceMicroseconds, LosesNothing) {
  EXPECT_EQ(trace_microseconds(0), "0.000");
  EXPECT_EQ(trace_microseconds(7), "0.007");
  EXPECT_EQ(trace_microseconds(1'234'567), "1234.567");
  EXPECT_EQ(trace_microseconds(std::numeric_limits<std::int64_t>::max()), "9223372036854775.807");
}

constexpr char kTrace[] = "{\"traceEvents\":[]}";

class TraceFileTest : public ::testing::Test {
 protected:
  testing::TemporaryFolder folder_;
  const std::filesystem::path target_ = folder_ / "t.json";
};

TEST_F(TraceFileTest, IsThereOnceItIsCommittedElseNothingIsLeft) {
  TraceFile file(target_);
  file.write("{\"traceEvents\":");
  file.write("[]}");
  EXPECT_FALSE(std::filesystem::exists(target_));
  file.commit();
  EXPECT_EQ(testing::read_file(target_), kTrace);
  EXPECT_THAT(names_in(folder_.path()), ElementsAre("t.json"));
  testing::write_file(target_, kTrace);
  { TraceFile(target_).write("half"); }
  EXPECT_THAT(names_in(folder_.path()), ElementsAre("t.json"));
  EXPECT_EQ(testing::read_file(target_), kTrace);
}

TEST_F(TraceFileTest, ReplacesAnEarlierTraceAndNothingElse) {
  for (const char* before : {kTrace, ""}) {
    testing::write_file(target_, before);
    TraceFile file(target_);
    file.write("{\"traceEvents\":[1]}");
    file.commit();
    EXPECT_EQ(testing::read_file(target_), "{\"traceEvents\":[1]}");
  }
  for (const char* before : {"{", "{\"format\": \"eventgan-manifest\"}"}) {
    testing::write_file(target_, before);
    EXPECT_THROWS(TraceFile{target_}, UsageError,
                  "--profile: expected a new file or an earlier trace");
    EXPECT_EQ(testing::read_file(target_), before);
  }
}

TEST_F(TraceFileTest, BehindALinkItReplacesWhatTheLinkPointsTo) {
  const testing::TemporaryFolder elsewhere;
  testing::write_file(elsewhere / "real.json", kTrace);
  std::filesystem::create_symlink(elsewhere / "real.json", target_);
  TraceFile file(target_);
  file.write("{\"traceEvents\":[2]}");
  file.commit();
  EXPECT_TRUE(std::filesystem::is_symlink(target_));
  EXPECT_EQ(testing::read_file(elsewhere / "real.json"), "{\"traceEvents\":[2]}");
  EXPECT_THAT(names_in(folder_.path()), ElementsAre("t.json"));
}

TEST_F(TraceFileTest, RefusesWhatCannotBeWritten) {
  EXPECT_THROWS(TraceFile{folder_.path()}, UsageError,
                "--profile: expected a file, got something else");
  EXPECT_THROWS(TraceFile{folder_ / "none" / "t.json"}, UsageError,
                "--profile: expected a file that can be written, got No such");
  EXPECT_THROWS(TraceFile{folder_ / ""}, UsageError,
                "--profile: expected a file, got a folder or nothing");
  EXPECT_THROWS(TraceFile{""}, UsageError, "--profile: expected a file, got a folder or nothing");
  EXPECT_THROWS(TraceFile{"/dev/null"}, UsageError,
                "--profile: expected a file, got something else, in /dev/null");
  EXPECT_THAT(names_in(folder_.path()), IsEmpty());
}

TEST_F(TraceFileTest, CleansUpAfterADeadWriterOfTheSameTraceAlone) {
  // A process of this one's number that wrote before this one began is dead.
  const auto long_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(2);
  for (const char* name : {".t.json.host.1.0.tmp", ".other.json.host.1.0.tmp"}) {
    testing::write_file(folder_ / name, "half");
    std::filesystem::last_write_time(folder_ / name, long_ago);
  }
  { const TraceFile file(target_); }
  EXPECT_THAT(names_in(folder_.path()), ElementsAre(".other.json.host.1.0.tmp"));
}

TEST_F(TraceFileTest, NamesItselfWhenTheDiskIsFull) {
  const std::string error = testing::error_on_full_disk(1000, [&] {
    TraceFile file(target_);
    file.write(std::string(2000, ' '));
  });
  EXPECT_THAT(error, ::testing::HasSubstr(target_.string()));
  EXPECT_THAT(names_in(folder_.path()), IsEmpty());
}

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
