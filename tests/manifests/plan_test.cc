#include "manifests/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace eventgan {
namespace {

Plan small_plan() {
  Plan plan;
  plan.name = "job";
  plan.manifest_text = "{ // a \"job\"\n}";
  plan.fingerprint = {{"weights", "aa"}, {"manifest", "bb"}};
  SourceSummary source;
  source.labelled_frames = 3;
  source.pairs_by_gap = {{1, 1}, {6, 1}};
  source.without_partner = 1;
  source.without_partner_ids = {"b"};
  source.faults = 1;
  source.notes = {"a \"note\""};
  plan.sources = {source};
  FrameRef previous{"root/a \xc3\xa9.png", 4, -1, 0.1};
  FrameRef next{"clip.mp4", 5, 17, std::nan("")};
  plan.shards = {
      {"job-train-00000-of-00001.h5",
       0,
       {3, 4},
       {{"s1", "seq", "label#1", {previous, next, 1, 5, 0.5}, ""},
        {"s2", "", "", {next, previous, 6, -1, 1}, "expected a frame, got no file, in x"}}}};
  return plan;
}

TEST(PlanJson, RoundTripsByteForByte) {
  const std::string text = to_json(small_plan());
  const Plan back = parse_plan(text, "plan.json");
  EXPECT_EQ(to_json(back), text);
  EXPECT_EQ(back.sample_count(), 2);
  EXPECT_EQ(back.manifest_text, small_plan().manifest_text);
  const PlannedSample& sample = back.shards[0].samples[0];
  EXPECT_EQ(sample.pair.previous.path, "root/a \xc3\xa9.png");
  EXPECT_EQ(sample.pair.previous.time_s, 0.1);
  EXPECT_EQ(sample.pair.next.video_frame, 17);
  EXPECT_TRUE(std::isnan(sample.pair.next.time_s));
  EXPECT_EQ(sample.pair.label_position, 0.5);
  EXPECT_EQ(back.shards[0].samples[1].fault, "expected a frame, got no file, in x");
  EXPECT_EQ(back.sources[0].pairs_by_gap, (std::map<int, std::int64_t>{{1, 1}, {6, 1}}));
}

TEST(PlanJson, OfNoShardsRoundTrips) {
  const std::string text = to_json(Plan{});
  EXPECT_EQ(to_json(parse_plan(text, "plan.json")), text);
}

TEST(PlanJson, NamesEveryFaultOfADamagedPlan) {
  std::string text = to_json(small_plan());
  text.replace(text.find("\"gap\":1"), 7, "\"gap\":9");
  text.replace(text.find("\"height\":3"), 10, "\"height\":0");
  try {
    parse_plan(text, "plan.json");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("$.shards[0].samples[0].gap"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("$.shards[0].height"));
  }
  EXPECT_THROW(parse_plan(text.substr(0, text.size() / 2), "plan.json"), std::runtime_error);
  EXPECT_THROW(parse_plan("", "plan.json"), std::runtime_error);
}

TEST(PlanJson, RefusesNamesThatAreNotUtf8) {
  Plan plan = small_plan();
  plan.shards[0].samples[0].sample_id = "\xff";
  EXPECT_THROW(to_json(plan), std::runtime_error);
}

TEST(FingerprintDifferences, NameTheFieldAndBothValues) {
  EXPECT_THAT(fingerprint_differences({{"a", "1"}, {"b", "2"}}, {{"a", "1"}, {"b", "2"}}),
              ::testing::IsEmpty());
  EXPECT_THAT(fingerprint_differences({{"a", "1"}, {"b", "2"}}, {{"a", "3"}, {"c", "4"}}),
              ::testing::ElementsAre("a: expected 1, got 3", "b: expected 2, got nothing",
                                     "c: expected nothing, got 4"));
}

}  // namespace
}  // namespace eventgan
