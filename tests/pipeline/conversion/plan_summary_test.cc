#include "pipeline/conversion/plan_summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/testing/fake_generator.h"
#include "tests/testing/small_job.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

class PlanSummary : public ::testing::Test {
 protected:
  PlanSummary() {
    manifest_.sources.resize(1);
    manifest_.sources[0].root = "kitti/training";
    manifest_.sources[0].dataset = DatasetKind::kKittiObject;
    manifest_.sources[0].pairs = {.gaps = {1, 3}, .choose = PairChoice::kAll};
    job_.unpaired_by_gap = {{{1, 3}, {3, 6}}};
    SourceSummary source;
    source.labelled_frames = 12;
    source.pairs_by_gap = {{1, 2}, {3, 1}};
    source.unpaired = 9;
    source.unpaired_ids = {"a", "b", "c", "d", "e", "f"};
    source.faults = 1;
    source.notes = {"2 images without labels"};
    job_.plan.sources = {source};
    job_.plan.shards.resize(1);
    job_.plan.shards[0].samples.resize(3);
  }

  JobManifest manifest_;
  PlannedJob job_;
  const TrialEstimate estimate_{2, 0.5, 90, 4e6};
};

TEST_F(PlanSummary, TextTellsWhatWillBeMadeAndWhatIsMissing) {
  EXPECT_EQ(
      plan_text(manifest_, job_, estimate_, 2),
      "kitti_object kitti/training (train)\n"
      "  labelled frames  12\n"
      "  pairs            3  (gap 1: 2, gap 3: 1)\n"
      "  no paired frame  9 of 24 possible pairs (labelled frames x gaps)  (gap 1: 3, gap 3: 6)\n"
      "  lacking a gap    6 of 12 labelled frames  (a, b, c, d, e, ...)\n"
      "  to quarantine    1  (a frame is missing inside the sequence, or a note says why)\n"
      "  note: 2 images without labels\n"
      "  shards           1\n"
      "total: 3 pairs in 1 shard, about 4 MB and 1m30s with 2 threads (0.500 s per pair on one "
      "thread, measured on 2 pairs)\n");
}

TEST_F(PlanSummary, CountsStills) {
  manifest_.sources[0].pairs.stills = StillsSpec();
  job_.plan.sources[0].unpaired = 0;
  const std::string text = plan_text(manifest_, job_, estimate_, 2);
  EXPECT_THAT(text, ::testing::HasSubstr("  stills under a drawn motion: 3\n  to quarantine"));
  EXPECT_EQ(nlohmann::json::parse(
                plan_summary_json(manifest_, job_, estimate_, 2))["sources"][0]["stills"],
            3);
  manifest_.sources[0].pairs.clip_frames = 21;
  EXPECT_THAT(plan_text(manifest_, job_, estimate_, 2),
              ::testing::HasSubstr("  clips of stills, 21 frames each\n"));
  manifest_.sources[0].pairs.clip_frames.reset();
  job_.plan.sources[0].unpaired = 6;
  EXPECT_THAT(plan_text(manifest_, job_, estimate_, 2), ::testing::HasSubstr("no paired frame"));
}

TEST_F(PlanSummary, SaysWhatIsEstimatedAndWhatIsMissing) {
  EXPECT_THAT(plan_text(manifest_, job_, {}, 1), ::testing::HasSubstr("no pair could be measured"));
  manifest_.generator.device = Device::kCuda;
  EXPECT_THAT(
      plan_text(manifest_, job_, estimate_, 2),
      ::testing::HasSubstr("measured on 2 pairs one by one; the device is faster in batches)\n"));
  job_.plan.sources[0].unpaired_ids = {};
  job_.unpaired_by_gap = {{}};
  EXPECT_THAT(plan_text(manifest_, job_, {}, 1),
              ::testing::HasSubstr(
                  "  no paired frame  0 of 24 possible pairs (labelled frames x gaps)\n  to "));
}

TEST_F(PlanSummary, JsonHasTheSameNumbers) {
  const auto json = nlohmann::json::parse(plan_summary_json(manifest_, job_, estimate_, 2));
  EXPECT_EQ(json["pairs"], 3);
  EXPECT_EQ(json["estimated_bytes"], 4e6);
  EXPECT_EQ(json["sources"][0]["pairs_by_gap"]["3"], 1);
  EXPECT_EQ(json["sources"][0]["stills"], 0);
  EXPECT_EQ(json["sources"][0]["unpaired"], 9);
  EXPECT_EQ(json["sources"][0]["unpaired_by_gap"]["3"], 6);
  EXPECT_EQ(json["sources"][0]["unpaired_frames"], 6);
  EXPECT_EQ(json["sources"][0]["unpaired_ids"].size(), 6u);
}

TEST_F(PlanSummary, OfOneGapAFrameItNamesThoseThatGiveNoPair) {
  manifest_.sources[0].pairs.choose = PairChoice::kOne;
  job_.plan.sources[0].unpaired = 2;
  job_.plan.sources[0].unpaired_ids = {"a", "b"};
  EXPECT_THAT(plan_text(manifest_, job_, {}, 1),
              ::testing::HasSubstr("  no paired frame  9 of 24 possible pairs (labelled frames x "
                                   "gaps)  (gap 1: 3, gap 3: 6)\n"
                                   "  no pair at all   2 of 12 labelled frames  (a, b)\n"));
}

TEST(MeasureTrial, ScalesAFewPairsToTheWholePlan) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 12);
  const PlannedJob job = make_plan(manifest, "w", "e");
  const testing::FakeGenerator generator;
  const TrialEstimate estimate = measure_trial(manifest, job, generator, 2);
  EXPECT_EQ(estimate.pairs_measured, 4);
  EXPECT_EQ(generator.calls(), 5);  // one more to warm up
  EXPECT_GT(estimate.seconds_per_pair, 0);
  EXPECT_NEAR(estimate.seconds, estimate.seconds_per_pair * 11 / 2, 1e-9);
  EXPECT_GT(estimate.stored_bytes, 0);
}

TEST(MeasureTrial, OfStillsItTriesSomeSpreadOverTheSource) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 41);
  PlannedJob job = make_plan(manifest, "w", "e");
  std::set<std::string> first;
  for (PlannedShard& shard : job.plan.shards) {
    for (PlannedSample& sample : shard.samples) {
      sample.pair.previous = sample.pair.next;
      sample.pair.motion = ImageMotion{.x_px = 1};
      if (first.size() == 10) continue;
      first.insert(sample.sample_id);
      testing::write_file(folder / sample.pair.next.path, "");
    }
  }
  // 17 of 40, of which the first ten cannot be read: one in four, and the one that warms up.
  const TrialEstimate estimate = measure_trial(manifest, job, testing::FakeGenerator(), 1);
  EXPECT_EQ(estimate.pairs_measured, 12);
  EXPECT_EQ(measure_trial(manifest, job, testing::FakeGenerator(), 1, 1).pairs_measured, 1);
}

TEST(MeasureTrial, CountsFlow) {
  const testing::TemporaryFolder folder;
  JobManifest manifest = testing::make_small_job(folder, 5);
  manifest.sources[0].pairs.stills.emplace();
  const auto bytes = [&](int deflate_level) {
    manifest.output.deflate_level = deflate_level;
    return measure_trial(manifest, make_plan(manifest, "w", "e"), testing::FakeGenerator(), 1)
        .stored_bytes;
  };
  const double volumes = bytes(0), small_volumes = bytes(1);
  manifest.sources[0].flow = true;
  const PlannedJob job = make_plan(manifest, "w", "e");
  const auto pixels = static_cast<double>(job.plan.shards[0].volume_size.pixel_count());
  const auto samples = static_cast<double>(job.plan.sample_count());
  EXPECT_EQ(bytes(0) - volumes, 5 * pixels * samples) << "x and y in 16 bits, the mask in 8";
  EXPECT_GT(bytes(1), small_volumes);
  EXPECT_LT(bytes(1) - small_volumes, 5 * pixels * samples);
}

TEST(MeasureTrial, LeavesOutPairsThatFail) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 3);
  const PlannedJob job = make_plan(manifest, "w", "e");
  testing::write_file(folder / "clip" / "f_11.png", "");  // of both pairs
  const TrialEstimate estimate = measure_trial(manifest, job, testing::FakeGenerator(), 2);
  EXPECT_EQ(estimate.pairs_measured, 0);
  EXPECT_EQ(estimate.seconds, 0);
}

TEST(MeasureTrial, TakesTheFirstPairWhereNoOtherCanBeTried) {
  const testing::TemporaryFolder folder;
  const JobManifest manifest = testing::make_small_job(folder, 3);
  const PlannedJob job = make_plan(manifest, "w", "e");
  testing::write_file(folder / "clip" / "f_12.png", "");  // of the second
  const TrialEstimate estimate = measure_trial(manifest, job, testing::FakeGenerator(), 2);
  EXPECT_EQ(estimate.pairs_measured, 1);
  EXPECT_GT(estimate.seconds, 0);
  EXPECT_GT(estimate.stored_bytes, 0);

  const testing::TemporaryFolder one;
  const JobManifest lone = testing::make_small_job(one, 2);
  const PlannedJob lone_job = make_plan(lone, "w", "e");
  EXPECT_EQ(measure_trial(lone, lone_job, testing::FakeGenerator(), 2).pairs_measured, 1);
}

}  // namespace
}  // namespace eventgan
