#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "manifests/documents/commit_record.h"
#include "pipeline/conversion/conversion_report.h"
#include "pipeline/conversion/retry.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

ConversionReport report() {
  ConversionReport result;
  result.folder = "out";
  result.planned = 10;
  result.written = 9;
  result.quarantined = {{3, "id", "expected an image, got rubbish, in a.png (id)"}};
  result.unpaired = result.unpaired_frames = 2;
  result.shards_planned = result.shards_done = result.plan_shards = 2;
  result.stored_bytes = 2'000'000;
  result.volume_bytes = 9'000'000;
  result.stage_seconds = {{"read", 1.25}, {"write", 0.5}};
  result.wall_seconds = 3.0;
  return result;
}

TEST(ReportText, SaysWhatWasWrittenLostAndSpent) {
  const std::string text = to_text(report());
  EXPECT_THAT(text, ::testing::HasSubstr("9 of 10 pairs written, 1 quarantined, in 2 of 2 shards"));
  EXPECT_THAT(text, ::testing::HasSubstr(
                        "2 MB, volumes compressed 4.5x, 3.0 s; busy seconds: read 1.2 write 0.5"));
  EXPECT_THAT(text, ::testing::HasSubstr("2 labelled frames without a paired frame"));
  EXPECT_THAT(text,
              ::testing::HasSubstr("quarantined: expected an image, got rubbish, in a.png (id)"));
}

TEST(ReportText, SaysBoxesByClass) {
  ConversionReport some = report();
  EXPECT_THAT(to_text(some), HasSubstr("\nEMPTY LABELS: no boxes and no persons with joints\n"));
  some.is_labelled = false;
  EXPECT_THAT(to_text(some), HasSubstr("\nNO LABELS: no boxes and no persons with joints\n"));
  some.is_labelled = true;
  some.boxes = {{"0", 9}};
  EXPECT_THAT(to_text(some), HasSubstr("\nboxes: 9 of class 0\n"));
  some.boxes.clear();
  some.persons = 12;
  EXPECT_THAT(to_text(some), HasSubstr("\n12 persons with joints\n"));
  some.boxes = {{"car", 1204}, {"person", 33}, {"tree", 1'234'567}};
  EXPECT_THAT(to_text(some), HasSubstr("\nboxes: 1,204 car, 33 person, 1,234,567 tree; 12 persons "
                                       "with joints\n"));
  EXPECT_THAT(to_json(some), HasSubstr("\"boxes\":{\"car\":1204,\"person\":33,"));
  some.is_labelled = false;
  EXPECT_THAT(to_text(some), HasSubstr("\n2 frames without a paired frame"));
  some.written = 0;
  EXPECT_THAT(to_text(some), Not(HasSubstr("boxes")));
  CommitRecord record;
  record.contents.classes = {{"car", 3}};
  record.contents.persons = {2, 0, 1};
  add_shard(record, 0, some);
  EXPECT_EQ(some.boxes.at("car"), 1207);
  EXPECT_EQ(some.persons, 15);
}

TEST(ReportText, TellsUnpairedFramesFromTheirPairs) {
  ConversionReport all = report();
  EXPECT_THAT(
      to_text(all),
      ::testing::HasSubstr("\n2 labelled frames without a paired frame (listed in plan.json)"));
  all.unpaired = 7;
  EXPECT_THAT(to_text(all),
              ::testing::HasSubstr("\n2 labelled frames without a paired frame for at least one of "
                                   "their gaps, 7 pairs in total (listed in plan.json)"));
  EXPECT_THAT(to_json(all), ::testing::HasSubstr("\"unpaired\":7"));
  EXPECT_THAT(to_json(all), ::testing::HasSubstr("\"unpaired_frames\":2"));
}

TEST(ReportText, SaysWhichPartAndWhoseWork) {
  ConversionReport part = report();
  part.part = "part 1 of 4 (--shards)";
  part.plan_shards = 8;
  part.shards_done_before = 1;
  part.shards_done_by_others = 1;
  EXPECT_THAT(to_text(part),
              ::testing::StartsWith("part 1 of 4 (--shards): 9 of 10 pairs written, 1 quarantined, "
                                    "in 2 of 2 shards (1 done before, 1 done by others)\n"));
  EXPECT_THAT(to_text(part), ::testing::Not(::testing::HasSubstr("stopped")));
  part.stopped = true;
  EXPECT_THAT(to_text(part), ::testing::HasSubstr("\nstopped on request"));
}

TEST(ReportText, HasTheNotesOnTheInputs) {
  EXPECT_THAT(to_text(report()), ::testing::Not(::testing::HasSubstr("note")));
  ConversionReport noted = report();
  noted.notes = {"clip.mp4: 60 of 100 frames"};
  EXPECT_THAT(to_text(noted), ::testing::HasSubstr(
                                  "\n1 note on the inputs:\n  note: clip.mp4: 60 of 100 frames\n"));
  EXPECT_THAT(to_json(noted), ::testing::HasSubstr(R"("notes":["clip.mp4: 60 of 100 frames"])"));
}

TEST(AddShard, CountsItsCommitRecord) {
  ConversionReport sum = report();
  CommitRecord record;
  record.size_bytes = 5;
  record.valid = 3;
  record.quarantined = {{0, "other", "reason"}};
  add_shard(record, 70, sum);
  EXPECT_EQ(sum.shards_done, 3);
  EXPECT_EQ(sum.written, 12);
  EXPECT_EQ(sum.quarantined.size(), 2u);
  EXPECT_EQ(sum.stored_bytes, 2'000'005);
  EXPECT_EQ(sum.volume_bytes, 9'000'070);
}

TEST(ReportText, CountsWhatItDoesNotListAndOfNothingHasNoRatio) {
  ConversionReport many = report();
  many.quarantined.assign(25, many.quarantined[0]);
  EXPECT_THAT(to_text(many), ::testing::HasSubstr("... and 5 more"));
  EXPECT_THAT(to_text(ConversionReport{}), ::testing::HasSubstr("compressed 0.0x"));
}

TEST(ReportJson, IsOneLine) {
  const std::string text = to_json(report());
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_THAT(text, ::testing::HasSubstr("\"compression_ratio\":4.5"));
  EXPECT_THAT(text, ::testing::HasSubstr("\"sample_id\":\"id\""));
  EXPECT_THAT(text, ::testing::HasSubstr("\"stopped\":false"));
  EXPECT_THAT(text, ::testing::HasSubstr("\"part\":\"all shards\""));
}

RetryReport example() {
  RetryReport report;
  report.folder = "/out";
  report.planned = 1000;
  report.tried = 3;
  report.mended = 2;
  report.failed = {{"job-train-00000-of-00002.h5", 4, "000007", "expected an image (000007)"}};
  report.quarantined = 5;
  report.shards_rewritten = 1;
  report.damaged_shards = {"/out/x.h5: expected size in bytes 5, got 4"};
  report.shards_missing = 7;
  return report;
}

TEST(RetryText, SaysWhatWasMendedAndWhatIsLeft) {
  EXPECT_EQ(to_text(example()),
            "/out/x.h5: expected size in bytes 5, got 4; eventgan convert makes it again\n"
            "7 shards not made yet: run eventgan convert\n"
            "2 of 3 quarantined samples fixed, 1 shard rewritten; still quarantined: 5 of 1000 "
            "samples\n"
            "quarantined: expected an image (000007)\n"
            "/out\n");
  RetryReport report;
  report.folder = "/out";
  EXPECT_EQ(to_text(report),
            "nothing to retry: no sample of a committed shard is quarantined\n/out\n");
  report = example();
  report.failed.resize(1000, report.failed[0]);
  EXPECT_THAT(to_text(report), HasSubstr("... and 980 more"));
}

TEST(RetryText, SaysThatInputsChangedOrThatItWasStopped) {
  RetryReport report;
  report.changed_inputs = {"annotations", "frames"};
  EXPECT_THAT(
      to_text(report),
      HasSubstr("inputs changed since the plan was frozen (annotations, frames): recorded"));
  EXPECT_EQ(nlohmann::json::parse(to_json(report))["changed_inputs"].size(), 2u);
  report = example();
  EXPECT_THAT(to_text(report), Not(HasSubstr("stopped")));
  report.stopped = true;
  report.dataset_outdated = true;
  EXPECT_THAT(to_text(report), HasSubstr("run again"));
  EXPECT_THAT(to_text(report), HasSubstr("eventgan finalize"));
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
  EXPECT_EQ(json["failed"][0]["reason"], "expected an image (000007)");
  EXPECT_EQ(json["shards_rewritten"], 1);
  EXPECT_EQ(json["damaged_shards"].size(), 1u);
  EXPECT_EQ(json["shards_missing"], 7);
  EXPECT_EQ(json["stopped"], false);
  EXPECT_EQ(json["too_many_faults"], false);
  EXPECT_EQ(json["dataset_outdated"], false);
}

}  // namespace
}  // namespace eventgan
