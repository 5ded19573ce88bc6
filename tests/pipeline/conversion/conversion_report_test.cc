#include "pipeline/conversion/conversion_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace eventgan {
namespace {

ConversionReport report() {
  ConversionReport result;
  result.folder = "out";
  result.planned = 10;
  result.written = 9;
  result.quarantined = {{3, "id", "expected a picture, got rubbish, in a.png (id)"}};
  result.without_partner = result.frames_without_partner = 2;
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
  EXPECT_THAT(text,
              ::testing::HasSubstr(
                  "2.0 MB, volumes compressed 4.5x, 3.0 s; busy seconds: read 1.2 write 0.5"));
  EXPECT_THAT(text, ::testing::HasSubstr("2 labelled frames without a partner"));
  EXPECT_THAT(text,
              ::testing::HasSubstr("quarantined: expected a picture, got rubbish, in a.png (id)"));
}

TEST(ReportText, TellsPairsWithoutPartnerFromTheirFrames) {
  ConversionReport all = report();
  EXPECT_THAT(
      to_text(all),
      ::testing::HasSubstr("\n2 labelled frames without a partner frame (listed in plan.json)"));
  all.without_partner = 7;
  EXPECT_THAT(to_text(all), ::testing::HasSubstr(
                                "\n2 labelled frames without a partner frame for one of their gaps "
                                "or more, 7 pairs in all (listed in plan.json)"));
  EXPECT_THAT(to_json(all), ::testing::HasSubstr("\"without_partner\":7"));
  EXPECT_THAT(to_json(all), ::testing::HasSubstr("\"frames_without_partner\":2"));
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

TEST(AddShard, CountsItsMarker) {
  ConversionReport sum = report();
  ShardMarker marker;
  marker.size_bytes = 5;
  marker.valid = 3;
  marker.quarantined = {{0, "other", "reason"}};
  add_shard(marker, 70, sum);
  EXPECT_EQ(sum.shards_done, 3);
  EXPECT_EQ(sum.written, 12);
  EXPECT_EQ(sum.quarantined.size(), 2u);
  EXPECT_EQ(sum.stored_bytes, 2'000'005);
  EXPECT_EQ(sum.volume_bytes, 9'000'070);
}

TEST(ReportText, CountsWhatItDoesNotList) {
  ConversionReport many = report();
  many.quarantined.assign(25, many.quarantined[0]);
  EXPECT_THAT(to_text(many), ::testing::HasSubstr("... and 5 more"));
}

TEST(ReportText, OfAnEmptyRunHasNoRatioOfNothing) {
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

}  // namespace
}  // namespace eventgan
