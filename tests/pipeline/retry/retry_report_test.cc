#include "pipeline/retry/retry_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

RetryReport example() {
  RetryReport report;
  report.folder = "/out";
  report.planned = 1000;
  report.tried = 3;
  report.mended = 2;
  report.failed = {{"job-train-00000-of-00002.h5", 4, "000007", "expected a picture (000007)"}};
  report.quarantined = 5;
  report.shards_rewritten = 1;
  report.damaged_shards = {"/out/x.h5: expected size in bytes 5, got 4"};
  report.shards_missing = 7;
  return report;
}

TEST(RetryText, SaysWhatWasMendedAndWhatIsLeft) {
  EXPECT_EQ(to_text(example()),
            "/out/x.h5: expected size in bytes 5, got 4; left to convert\n"
            "7 shards not made yet: left to convert\n"
            "2 of 3 quarantined samples mended, 1 shard written again; 5 of 1000 samples are "
            "quarantined still\n"
            "quarantined: expected a picture (000007)\n"
            "/out\n");
}

TEST(RetryText, SaysThatThereIsNothingToDo) {
  RetryReport report;
  report.folder = "/out";
  EXPECT_EQ(to_text(report),
            "nothing to retry: no sample of a committed shard is quarantined\n/out\n");
}

TEST(RetryText, SaysThatChangedInputsWereRecorded) {
  RetryReport report;
  report.changed_inputs = {"annotations", "frames"};
  EXPECT_THAT(
      to_text(report),
      HasSubstr("inputs changed since the plan was frozen (annotations, frames): recorded"));
  EXPECT_EQ(nlohmann::json::parse(to_json(report))["changed_inputs"].size(), 2u);
}

TEST(RetryText, SaysThatItWasStoppedAndThatTheDatasetIsOutdated) {
  RetryReport report = example();
  EXPECT_THAT(to_text(report), Not(HasSubstr("stopped")));
  report.stopped = true;
  report.dataset_outdated = true;
  EXPECT_THAT(to_text(report), HasSubstr("run again"));
  EXPECT_THAT(to_text(report), HasSubstr("eventgan finalize"));
}

TEST(RetryText, OfVeryManyTellsTheFirst) {
  RetryReport report = example();
  report.failed.resize(1000, report.failed[0]);
  EXPECT_THAT(to_text(report), HasSubstr("... and 980 more"));
}

TEST(RetryJson, HasEveryField) {
  const auto json = nlohmann::json::parse(to_json(example()));
  EXPECT_EQ(json["event"], "report");
  EXPECT_EQ(json["folder"], "/out");
  EXPECT_EQ(json["planned"], 1000);
  EXPECT_EQ(json["tried"], 3);
  EXPECT_EQ(json["mended"], 2);
  EXPECT_EQ(json["quarantined"], 5);
  EXPECT_EQ(json["failed"].size(), 1u);
  EXPECT_EQ(json["failed"][0]["sample_id"], "000007");
  EXPECT_EQ(json["failed"][0]["shard"], "job-train-00000-of-00002.h5");
  EXPECT_EQ(json["failed"][0]["slot"], 4);
  EXPECT_EQ(json["failed"][0]["reason"], "expected a picture (000007)");
  EXPECT_EQ(json["shards_rewritten"], 1);
  EXPECT_EQ(json["damaged_shards"].size(), 1u);
  EXPECT_EQ(json["shards_missing"], 7);
  EXPECT_EQ(json["stopped"], false);
  EXPECT_EQ(json["too_many_faults"], false);
  EXPECT_EQ(json["dataset_outdated"], false);
}

}  // namespace
}  // namespace eventgan
