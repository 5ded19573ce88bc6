#include "pipeline/planning/make_plan.h"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "tests/testing/image_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

struct Source {
  std::string split;
  std::vector<ImageSize> sizes;  // of its samples s0, s1, ...; {0, 0}: unknown
};

std::vector<PlannedShard> lay_out(const std::vector<Source>& sources, int samples_per_shard) {
  ShardLayout layout("job", [=](int, ImageSize) { return samples_per_shard; });
  for (std::size_t i = 0; i < sources.size(); ++i) {
    layout.begin_source(static_cast<int>(i), sources[i].split);
    for (std::size_t k = 0; k < sources[i].sizes.size(); ++k) {
      const std::string id = "s" + std::to_string(k);
      layout.add({id, "", "", {{"0.png", 0}, {id + ".png", 1}}, ""}, sources[i].sizes[k]);
    }
  }
  return layout.finish();
}

std::vector<std::string> ids(const PlannedShard& shard) {
  std::vector<std::string> result;
  for (const PlannedSample& sample : shard.samples) result.push_back(sample.sample_id);
  return result;
}

const ImageSize kSmall{2, 3}, kLarge{20, 30};

TEST(ShardLayout, NumbersShardsWithinTheirSplitOverAllSources) {
  const auto shards =
      lay_out({{"train", {kSmall, kSmall, kSmall}}, {"val", {kSmall}}, {"train", {kSmall}}}, 2);
  ASSERT_EQ(shards.size(), 4u);
  EXPECT_EQ(shards[0].name, "job-train-00000-of-00003.h5");
  EXPECT_EQ(shards[1].name, "job-train-00001-of-00003.h5");
  EXPECT_EQ(shards[2].name, "job-val-00000-of-00001.h5");
  EXPECT_EQ(shards[3].name, "job-train-00002-of-00003.h5");
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0", "s1"));
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s2"));
  EXPECT_EQ(shards[3].source, 2);
}

TEST(ShardLayout, AShardHoldsOneSize) {
  const auto shards = lay_out({{"train", {kSmall, kLarge, kSmall, kLarge, kLarge}}}, 8);
  ASSERT_EQ(shards.size(), 2u);
  EXPECT_EQ(shards[0].volume_size, kSmall);
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0", "s2"));
  EXPECT_EQ(shards[1].volume_size, kLarge);
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s1", "s3", "s4"));
}

TEST(ShardLayout, AnUnreadableImageHasAShardOfItsOwnThatGuessesTheMostCommonSize) {
  const auto shards =
      lay_out({{"train", {kSmall, {}, kLarge, {}, kLarge}}, {"train", {{}, kSmall}}}, 8);
  ASSERT_EQ(shards.size(), 6u);
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("s0"));
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("s2", "s4"));
  EXPECT_FALSE(shards[1].size_unknown);
  for (const int own : {2, 3}) {
    EXPECT_TRUE(shards[own].size_unknown);
    EXPECT_EQ(shards[own].volume_size, kLarge);
    EXPECT_EQ(shards[own].source, 0);
  }
  EXPECT_THAT(ids(shards[2]), ::testing::ElementsAre("s1"));
  EXPECT_THAT(ids(shards[3]), ::testing::ElementsAre("s3"));
  EXPECT_EQ(shards[5].name, "job-train-00005-of-00006.h5");
  EXPECT_THAT(ids(shards[5]), ::testing::ElementsAre("s0")) << "of the next source";
  EXPECT_EQ(shards[5].volume_size, kSmall);
}

TEST(ShardLayout, OfUnknownSizesGuessesTheMostCommon) {
  const auto shards = lay_out({{"train", {{}, {}}}}, 8);
  ASSERT_EQ(shards.size(), 2u);
  EXPECT_EQ(shards[0].volume_size, (ImageSize{1, 1}));
  EXPECT_TRUE(shards[0].size_unknown);
  EXPECT_EQ(lay_out({{"train", {{}, kLarge, kSmall}}}, 8).back().volume_size, kLarge);
}

TEST(ShardLayout, SamplesOfOneUnreadableVideoShareShards) {
  ShardLayout layout("job", [](int, ImageSize) { return 2; });
  layout.begin_source(0, "train");
  for (const char* video : {"a.mp4", "a.mp4", "a.mp4", "b.mp4"}) {
    layout.add({video, "", "", {{video, 0}, {video, 1}}, ""}, {});
  }
  const auto shards = layout.finish();
  ASSERT_EQ(shards.size(), 3u);
  EXPECT_THAT(ids(shards[0]), ::testing::ElementsAre("a.mp4", "a.mp4"));
  EXPECT_THAT(ids(shards[1]), ::testing::ElementsAre("a.mp4"));
  EXPECT_THAT(ids(shards[2]), ::testing::ElementsAre("b.mp4"));
}

TEST(ShardLayout, SamplesOfASequenceWithoutAnyImageShareShards) {
  ShardLayout layout("job", [](int, ImageSize) { return 2; });
  layout.begin_source(0, "train");
  const auto add = [&](const char* id, const char* sequence, std::int64_t index, ImageSize size) {
    const FrameRef frame{std::string(id) + ".png", index};
    layout.add({id, sequence, "", {frame, frame}, ""}, size);
  };
  for (const char* id : {"a1", "a2", "a3"}) add(id, "a", -1, {});
  add("b1", "b", -1, {});
  add("b2", "b", 2, {});  // an image that cannot be read
  add("b3", "b", 3, {});
  add("b4", "b", 4, kSmall);
  add("b5", "b", -1, {});
  const auto shards = layout.finish();
  std::vector<std::vector<std::string>> samples;
  for (const PlannedShard& shard : shards) samples.push_back(ids(shard));
  EXPECT_EQ(samples, (std::vector<std::vector<std::string>>{
                         {"b4"}, {"a1", "a2"}, {"a3"}, {"b1"}, {"b2"}, {"b3"}, {"b5"}}));
  for (std::size_t i = 1; i < shards.size(); ++i) {
    EXPECT_TRUE(shards[i].size_unknown);
    EXPECT_EQ(shards[i].volume_size, kSmall);
  }
}

TEST(SamplesPerShard, AreWhatTheManifestSaysOrWhatOneCoreMakesInTwentySeconds) {
  struct Case {
    GeneratorKind kind;
    std::string weights;
    ImageSize size;
    bool cuts_out;
    int samples;
  };
  const ImageSize kitti{260, 861};
  for (const Case& one : std::vector<Case>{
           {GeneratorKind::kNetwork, "shipped:8", kitti, false, 64},          // 34 ms a pair
           {GeneratorKind::kNetwork, "my.safetensors", kitti, false, 36},     // 0.55 s
           {GeneratorKind::kNetwork, "untrained:32", {720, 1280}, false, 8},  // 2.3 s
           {GeneratorKind::kEsim, "shipped", {960, 1280}, true, 47},          // 0.3 s and 0.12 s
           {GeneratorKind::kDifference, "shipped", {}, false, 64}}) {
    JobManifest manifest;
    manifest.generator.kind = one.kind;
    manifest.generator.weights = one.weights;
    SourceSpec source;
    if (one.cuts_out) source.pairs.stills = StillsSpec{.objects = ObjectMotionSpec()};
    EXPECT_EQ(samples_per_shard(manifest, source, one.size), one.samples) << one.weights;
    manifest.output.samples_per_shard = 1000;
    EXPECT_EQ(samples_per_shard(manifest, source, one.size), 1000);
  }
}

TEST(ShardLayout, OfNothingIsNothing) {
  EXPECT_TRUE(lay_out({}, 8).empty());
  EXPECT_TRUE(lay_out({{"train", {}}}, 8).empty());
}

class MakePlan : public ::testing::Test {
 protected:
  MakePlan() {
    manifest_.name = "job";
    manifest_.text = "{}";
    manifest_.directory = folder_.path();
    manifest_.output.samples_per_shard = 2;
    for (const char* name : {"f_00.png", "f_01.png", "f_02.png", "f_03.png"}) {
      testing::write_flat_image(folder_ / "clip" / name, {4, 6}, 100);
    }
    SourceSpec source;
    source.dataset = DatasetKind::kFrames;
    source.root = "clip";
    source.pairs = {.gaps = {1}};
    manifest_.sources = {source};
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
};

TEST_F(MakePlan, CountsFramesPairsAndWhatIsUnpaired) {
  const Plan plan = make_plan(manifest_, "w", "e").plan;
  EXPECT_EQ(plan.sample_count(), 3);
  ASSERT_EQ(plan.sources.size(), 1u);
  EXPECT_EQ(plan.sources[0].labelled_frames, 4);
  EXPECT_EQ(plan.sources[0].unpaired, 1);
  EXPECT_EQ(plan.sources[0].unpaired_ids.size(), 1u);
  EXPECT_EQ(plan.sources[0].pairs_by_gap.at(1), 3);
  EXPECT_EQ(plan.shards.size(), 2u);
}

TEST_F(MakePlan, KeepsTheSourcesSizeUnlessOneIsGiven) {
  EXPECT_EQ(make_plan(manifest_, "w", "e").plan.shards[0].volume_size, (ImageSize{4, 6}));
  manifest_.image.size = ImageSize{16, 20};
  EXPECT_EQ(make_plan(manifest_, "w", "e").plan.shards[0].volume_size, (ImageSize{16, 20}));
}

TEST_F(MakePlan, GroupsImagesBySize) {
  testing::write_flat_image(folder_ / "clip" / "f_03.png", {8, 6}, 100);
  const Plan plan = make_plan(manifest_, "w", "e").plan;
  ASSERT_EQ(plan.shards.size(), 2u);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{8, 6}));
}

TEST_F(MakePlan, SaysWhichSamplesHaveNoKnownSizeAndFindsItOnceTheyAreMended) {
  for (const char* name : {"f_02.png", "f_03.png"}) {
    testing::write_file(folder_ / "clip" / name, "not an image");
  }
  auto [plan, by_gap, datasets, warnings] = make_plan(manifest_, "w", "e");
  ASSERT_EQ(plan.shards.size(), 2u);  // of the pairs 0-1 and 1-2, and of 2-3
  EXPECT_TRUE(plan.shards[1].size_unknown);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{4, 6}));
  const std::string& id = plan.shards[1].samples.at(0).sample_id;
  EXPECT_THAT(plan.sources[0].notes, testing::texts_with({{"1 sample without a readable image",
                                                           "(" + id + ")", "eventgan retry"}}));
  complete_plan(manifest_, datasets, plan);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{4, 6})) << "the guess stays";
  testing::write_flat_image(folder_ / "clip" / "f_03.png", {8, 10}, 100);
  complete_plan(manifest_, datasets, plan);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{8, 10}));
  EXPECT_EQ(plan.shards[0].volume_size, (ImageSize{4, 6}));
}

TEST_F(MakePlan, LabelsWithoutImagesShareShards) {
  std::string table = "image,class,left,top,right,bottom\nf_01.png,car,1,1,3,3\n";
  for (int i = 0; i < 5; ++i) table += "gone_" + std::to_string(i) + ".png,car,1,1,3,3\n";
  testing::write_file(folder_ / "boxes.csv", table);
  manifest_.sources[0].labels = LabelSpec{LabelFormat::kCsv, "boxes.csv"};
  auto [plan, by_gap, datasets, warnings] = make_plan(manifest_, "w", "e");
  ASSERT_EQ(plan.shards.size(), 4u);  // f_01's, and 5 samples by 2
  EXPECT_EQ(plan.sources[0].faults, 5);
  EXPECT_THAT(ids(plan.shards[1]), ::testing::ElementsAre("gone_0", "gone_1"));
  EXPECT_TRUE(plan.shards[1].size_unknown);
  // Once they are there, with the image before the first, all is as it would be planned anew.
  for (const char* name : {"gone_0.png", "gone_1.png"}) {
    testing::write_flat_image(folder_ / "clip" / name, {8, 10}, 100);
  }
  complete_plan(manifest_, make_plan(manifest_, "w", "e").datasets, plan);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{8, 10}));
  EXPECT_EQ(plan.shards[1].samples.at(1).fault, "");
  EXPECT_EQ(plan.shards[2].volume_size, (ImageSize{4, 6})) << "the guess stays";
}

TEST_F(MakePlan, SplitsWhoseEdgesCountFromOthersAreTold) {
  for (const std::string folder : {"x", "y"}) {
    const std::string left = folder == "x" ? "1" : "0";
    testing::write_file(folder_ / folder / "f_01.xml",
                        "<annotation><object><name>a</name><bndbox><xmin>" + left +
                            "</xmin><ymin>1</ymin><xmax>3</xmax><ymax>3</ymax></bndbox></object>"
                            "</annotation>");
  }
  manifest_.sources.push_back(manifest_.sources[0]);
  manifest_.sources[1].split = "val";
  manifest_.sources[0].labels = LabelSpec{LabelFormat::kVoc, "x"};
  manifest_.sources[1].labels = LabelSpec{LabelFormat::kVoc, "y"};
  EXPECT_THAT(make_plan(manifest_, "w", "e").warnings,
              ::testing::ElementsAre(
                  ::testing::StartsWith("edges count from 0 in clip and from 1 in clip: ")));
  for (SourceSpec& source : manifest_.sources) source.labels->edges_from = 0;
  EXPECT_THAT(make_plan(manifest_, "w", "e").warnings, ::testing::IsEmpty());
}

TEST_F(MakePlan, AMissingFrameThatWasAddedBecomesWhatItWouldBePlannedAsToday) {
  for (const PairChoice choice : {PairChoice::kOne, PairChoice::kAll}) {
    manifest_.sources[0].pairs.choose = choice;
    const Plan whole = make_plan(manifest_, "w", "e").plan;
    const PlannedSample& meant = whole.shards[0].samples.at(1);  // of f_01 and f_02
    const std::string image = testing::read_file(folder_ / "clip" / "f_01.png");
    std::filesystem::remove(folder_ / "clip" / "f_01.png");
    auto [plan, by_gap, datasets, warnings] = make_plan(manifest_, "w", "e");
    const PlannedSample& missing = plan.shards.at(0).samples.at(0);
    ASSERT_EQ(missing.sample_id, meant.sample_id);
    const std::string before = to_json(plan);
    complete_plan(manifest_, datasets, plan);
    EXPECT_EQ(to_json(plan), before) << "a missing frame still";
    EXPECT_THAT(missing.fault, ::testing::HasSubstr("got no file"));

    testing::write_file(folder_ / "clip" / "f_01.png", image);
    complete_plan(manifest_, make_plan(manifest_, "w", "e").datasets, plan);
    EXPECT_EQ(missing.fault, "");
    EXPECT_EQ(missing.pair.previous.path, meant.pair.previous.path);
    EXPECT_EQ(missing.pair.next.path, meant.pair.next.path);
    EXPECT_EQ(plan.sample_count(), 2);
  }
}

TEST_F(MakePlan, ALabelThatHasMovedWithinItsFileIsFoundByItsFrame) {
  for (const PairChoice choice : {PairChoice::kOne, PairChoice::kAll}) {
    manifest_.sources[0].pairs.choose = choice;
    testing::write_file(folder_ / "clip" / "f_01.json", "{}");
    auto [plan, by_gap, datasets, warnings] = make_plan(manifest_, "w", "e");
    const std::string whole = to_json(plan);
    PlannedSample& sample = plan.shards.at(0).samples.at(0);
    ASSERT_NE(sample.label_key, "");
    sample.label_key = "another's";
    sample.pair.next.time_s = 99;
    renew_samples(manifest_, datasets, plan);
    EXPECT_EQ(to_json(plan), whole);

    sample.sample_id.replace(0, 4, "gone");
    renew_samples(manifest_, datasets, plan);
    EXPECT_THAT(sample.fault, ::testing::HasSubstr("got none any more, in clip/f_01.png (gone"));
    datasets[0].reset();
    sample.fault.clear();
    renew_samples(manifest_, datasets, plan);
    EXPECT_EQ(sample.fault, "") << "nobody knows";
  }
}

TEST_F(MakePlan, SaysForWhichPairsTheTimeOfNoiseIsNotTheirOwn) {
  const auto notes = [&] { return make_plan(manifest_, "w", "e").plan.sources[0].notes; };
  EXPECT_THAT(notes(), ::testing::IsEmpty());
  manifest_.generator.noise = NoiseSpec();
  manifest_.generator.duration_s = 0.05;
  EXPECT_THAT(notes(), ::testing::ElementsAre(::testing::MatchesRegex(
                           "no times of [0-9] pairs: their noise is that of duration_s, 0.05 s")));
  manifest_.sources[0].frames_per_second = 10;
  EXPECT_THAT(notes(), ::testing::IsEmpty());
}

TEST_F(MakePlan, CountsForEachGapWhatIsUnpaired) {
  manifest_.sources[0].pairs.gaps = {1, 3, 6};
  const PlannedJob job = make_plan(manifest_, "w", "e");  // 4 frames
  EXPECT_THAT(job.unpaired_by_gap,
              ::testing::ElementsAre(std::map<int, std::int64_t>{{1, 1}, {3, 3}, {6, 4}}));
  EXPECT_EQ(job.plan.sources[0].unpaired, 1) << "the others draw gap 1";
}

TEST_F(MakePlan, ALimitIsSharedByTheSources) {
  const auto planned = [&](std::int64_t limit) {
    const Plan plan = make_plan(manifest_, "w", "e", {.limit = limit}).plan;
    EXPECT_EQ(limit_of(plan.fingerprint), limit);
    std::vector<std::int64_t> pairs;
    for (const SourceSummary& source : plan.sources) {
      pairs.push_back(source.pairs_by_gap.empty() ? 0 : source.pairs_by_gap.at(1));
    }
    return pairs;
  };
  EXPECT_EQ(limit_of(make_plan(manifest_, "w", "e").plan.fingerprint), std::nullopt);
  manifest_.sources.push_back(manifest_.sources[0]);  // three pairs each
  manifest_.sources[0].pairs.min_pairs = 3;           // of the whole job, not of a trial
  EXPECT_THAT(planned(1), ::testing::ElementsAre(1, 0));
  EXPECT_THAT(planned(3), ::testing::ElementsAre(2, 1));
  EXPECT_THAT(planned(5), ::testing::ElementsAre(3, 2));
  EXPECT_THAT(planned(100), ::testing::ElementsAre(3, 3));
  manifest_.sources[0].pairs = {.gaps = {1, 2}, .choose = PairChoice::kAll};
  EXPECT_THAT(planned(6), ::testing::ElementsAre(2, 3)) << "a frame's second pair is one more";
  manifest_.sources[0].pairs.min_pairs = 6;
  EXPECT_THROWS(planned(100), InputError,
                "expected at least 6 pairs (pairs.min_pairs), got 5 of 4");
}

TEST_F(MakePlan, ATrialTakesTheFirstPairsAsTheWholeJobHasThem) {
  manifest_.sources[0].pairs.gaps = {1, 2};
  const Plan whole = make_plan(manifest_, "w", "e").plan;
  const Plan trial = make_plan(manifest_, "w", "e", {.limit = 2}).plan;
  ASSERT_EQ(trial.shards.size(), 1u);
  EXPECT_EQ(ids(trial.shards[0]), ids(whole.shards[0]));
  for (std::size_t slot = 0; slot < 2; ++slot) {
    EXPECT_EQ(trial.shards[0].samples[slot].pair.gap_frames,
              whole.shards[0].samples[slot].pair.gap_frames);
  }
  EXPECT_EQ(trial.sources[0].labelled_frames, 3)
      << "one has no paired frame, the last is not asked";
  EXPECT_THAT(fingerprint_differences(whole.fingerprint, trial.fingerprint),
              ::testing::Contains("limit: expected nothing, got 2"));
}

TEST_F(MakePlan, StopsAtAnyFrameOrFile) {
  int asked = 0;
  make_plan(manifest_, "w", "e", {[&] {
              ++asked;
              return false;
            }});
  EXPECT_EQ(asked, 4 + 3 * 2);  // labelled frames; the frames of the three that have a paired frame
  for (int last = 1; last <= 10; ++last) {
    asked = 0;
    EXPECT_THROWS(make_plan(manifest_, "w", "e", {[&] { return ++asked == last; }}), Stopped,
                  "stopped while planning; nothing was written: run again");
    EXPECT_EQ(asked, last);
  }
}

TEST_F(MakePlan, TooFewPairsAreAnError) {
  manifest_.sources[0].pairs.min_pairs = 4;
  EXPECT_THROWS(make_plan(manifest_, "w", "e"), InputError, "got 3 of 4 labelled frames, in clip");
}

TEST_F(MakePlan, AddingASourceDoesNotMoveThePairsOfAnother) {
  manifest_.sources[0].pairs.gaps = {1, 2, 3};
  const Plan alone = make_plan(manifest_, "w", "e").plan;
  for (const char* name : {"g_1.png", "g_2.png", "g_3.png"}) {
    testing::write_flat_image(folder_ / "other" / name, {4, 6}, 100);
  }
  SourceSpec other = manifest_.sources[0];
  other.root = "other";
  manifest_.sources.push_back(other);
  const Plan both = make_plan(manifest_, "w", "e").plan;
  std::vector<int> before, after;
  for (const auto& shard : alone.shards) {
    for (const auto& sample : shard.samples) before.push_back(sample.pair.gap_frames);
  }
  for (const auto& shard : both.shards) {
    if (shard.source != 0) continue;
    for (const auto& sample : shard.samples) after.push_back(sample.pair.gap_frames);
  }
  EXPECT_EQ(before, after);
}

TEST_F(MakePlan, SourcesWithTheSameIdsDrawForThemselves) {
  // 300 frames a source: of three gaps they draw the same for about a third.
  for (int i = 0; i < 300; ++i) {
    for (const char* folder : {"one", "two"}) {
      testing::write_file(folder_ / folder / ("f_" + std::to_string(1000 + i) + ".png"), "");
    }
  }
  manifest_.image.size = ImageSize{24, 32};
  SourceSpec& one = manifest_.sources[0];
  one.root = "one";
  one.pairs.gaps = {1, 2, 3};
  SourceSpec two = one;
  two.root = "two";
  manifest_.sources.push_back(two);
  const Plan plan = make_plan(manifest_, "w", "e").plan;
  std::map<std::string, std::vector<int>> gaps;
  for (const auto& shard : plan.shards) {
    for (const auto& sample : shard.samples) {
      gaps[sample.sample_id].push_back(sample.pair.gap_frames);
    }
  }
  int same = 0;
  for (const auto& [id, of_sources] : gaps) same += of_sources.front() == of_sources.back();
  EXPECT_NEAR(same, 100, 35);  // four standard deviations
}

/// The motions of a source's stills, in the plan's order.
std::vector<ImageMotion> motions(const Plan& plan, int source = 0) {
  std::vector<ImageMotion> all;
  for (const PlannedShard& shard : plan.shards) {
    if (shard.source != source) continue;
    for (const PlannedSample& sample : shard.samples) {
      EXPECT_EQ(sample.pair.previous, sample.pair.next);
      EXPECT_EQ(sample.pair.previous.index, sample.pair.label_index);
      all.push_back(sample.pair.motion.value());
    }
  }
  return all;
}

class MakePlanOfStills : public MakePlan {
 protected:
  MakePlanOfStills() {
    source().pairs.gaps = {1};
    source().pairs.stills = StillsSpec();
  }

  SourceSpec& source() { return manifest_.sources[0]; }
  Plan plan() { return make_plan(manifest_, "w", "e").plan; }
};

TEST_F(MakePlanOfStills, EveryLabelledFrameIsPairedWithItself) {
  source().pairs.stills->frames = 3;
  source().pairs.gaps = {3};
  source().frames_per_second = 10;
  for (const PairSide side : {PairSide::kBefore, PairSide::kAfter}) {
    source().pairs.side = side;
    const Plan stills = plan();
    EXPECT_EQ(stills.sources[0].pairs_by_gap, (std::map<int, std::int64_t>{{3, 4}}));
    EXPECT_EQ(stills.sources[0].unpaired, 0);
    EXPECT_EQ(motions(stills).size(), 4u);
    const FramePair& pair = stills.shards[0].samples[1].pair;
    EXPECT_EQ(pair.label_position, side == PairSide::kBefore ? 1 : 0);
    const FrameRef& labelled = side == PairSide::kBefore ? pair.next : pair.previous;
    const FrameRef& moved = side == PairSide::kBefore ? pair.previous : pair.next;
    EXPECT_EQ(labelled.path, "clip/f_01.png");
    EXPECT_DOUBLE_EQ(labelled.time_s, 0.1);
    EXPECT_TRUE(std::isnan(moved.time_s)) << "nobody knows when";
    EXPECT_TRUE(std::isnan(pair.gap_s()));
  }
}

TEST_F(MakePlanOfStills, EachBecomesAClipOfPairsThatFollowEachOther) {
  source().pairs.clip_frames = 3;
  source().frames_per_second = 10;
  for (const PairSide side : {PairSide::kBefore, PairSide::kAfter}) {
    source().pairs.side = side;
    const Plan clips = plan();
    EXPECT_EQ(clips.sources[0].pairs_by_gap, (std::map<int, std::int64_t>{{1, 12}}));
    EXPECT_EQ(clips.sources[0].unpaired, 0);
    int number = 0;
    for (const PlannedShard& shard : clips.shards) {
      for (const PlannedSample& sample : shard.samples) {
        const FramePair& pair = sample.pair;
        EXPECT_FALSE(pair.motion);
        EXPECT_EQ(pair.previous.path, pair.next.path);
        EXPECT_EQ(pair.previous.index, number % 3);
        EXPECT_EQ(pair.next.index, number % 3 + 1);
        EXPECT_EQ(pair.label_index, side == PairSide::kBefore ? number % 3 + 1 : number % 3);
        EXPECT_NEAR(pair.gap_s(), 0.1, 1e-12);
        ++number;
      }
    }
    EXPECT_EQ(number, 12);
  }
}

TEST_F(MakePlanOfStills, AsManyImagesRestAsTheManifestSays) {
  source().pairs.stills->rests = 1;
  EXPECT_EQ(motions(plan()), std::vector<ImageMotion>(4));
}

TEST_F(MakePlanOfStills, SaysHowManyObjectsCanMoveOnTheirOwn) {
  source().pairs.stills->objects.emplace();
  EXPECT_THAT(plan().sources[0].notes,
              ::testing::Contains(::testing::AllOf(
                  ::testing::HasSubstr("0 of 0 boxes (of 4 labelled frames looked at) have an "
                                       "outline"),
                  ::testing::HasSubstr("everything moves as the image does"))));
}

TEST_F(MakePlanOfStills, MotionsAreDrawnWithinTheirLimitsAndFillThem) {
  for (int i = 4; i < 300; ++i) {
    testing::write_flat_image(folder_ / "clip" / fmt::format("f_{:03}.png", i), {1, 1}, 1);
  }
  source().pairs.stills = StillsSpec{{2, 8}, 3, 0.1, 1};
  double shortest = 9, longest = 0, least_angle = 9, most_angle = -9, smallest = 9, largest = 0;
  int right = 0, down = 0;
  const std::vector<ImageMotion> drawn = motions(plan());
  ASSERT_EQ(drawn.size(), 300u);
  for (const ImageMotion& motion : drawn) {
    const double length = std::hypot(motion.x_px, motion.y_px);
    shortest = std::min(shortest, length);
    longest = std::max(longest, length);
    least_angle = std::min(least_angle, motion.angle_deg);
    most_angle = std::max(most_angle, motion.angle_deg);
    smallest = std::min(smallest, motion.scale);
    largest = std::max(largest, motion.scale);
    right += motion.x_px > 0;
    down += motion.y_px > 0;
  }
  const auto expect_spans = [](double least, double most, double from, double to) {
    EXPECT_GE(least, from - 1e-9);
    EXPECT_LE(most, to + 1e-9);
    EXPECT_GT(most - least, 0.95 * (to - from));
  };
  expect_spans(shortest, longest, 2, 8);
  expect_spans(least_angle, most_angle, -3, 3);
  expect_spans(smallest, largest, 0.9, 1.1);
  EXPECT_NEAR(right, 150, 35);  // four standard deviations
  EXPECT_NEAR(down, 150, 35);

  source().pairs.stills = StillsSpec{{0, 0}, 0, 0, 1};
  EXPECT_EQ(motions(plan()), std::vector<ImageMotion>(300));
}

TEST_F(MakePlanOfStills, TheSeedAndTheSampleAloneDecideTheMotion) {
  const std::vector<ImageMotion> alone = motions(plan());
  EXPECT_EQ(motions(plan()), alone);
  EXPECT_NE(alone[0], alone[1]);
  const auto changed = parse_plan(to_json(plan()), "plan");
  EXPECT_EQ(motions(changed), alone) << "the frozen plan has every bit of them";
  for (const char* name : {"g_1.png", "f_02.png"}) {
    testing::write_flat_image(folder_ / "other" / name, {4, 6}, 100);
  }
  SourceSpec other = source();
  other.root = "other";
  manifest_.sources.push_back(other);
  EXPECT_EQ(motions(plan(), 0), alone) << "whatever sources follow";
  manifest_.sources.pop_back();
  ++manifest_.seed;
  EXPECT_NE(motions(plan()), alone);
}

TEST_F(MakePlanOfStills, RenewedOnesKeepTheirMotionAndUnknownTime) {
  source().frames_per_second = 10;
  testing::write_file(folder_ / "clip" / "f_01.json", "{}");
  auto [plan, by_gap, datasets, warnings] = make_plan(manifest_, "w", "e");
  const std::string whole = to_json(plan);
  plan.shards[0].samples[0].label_key = "another's";
  plan.shards[0].samples[0].pair.next.time_s = 99;
  complete_plan(manifest_, datasets, plan);
  EXPECT_EQ(to_json(plan), whole);
  plan.shards[0].samples[0].fault = "expected a frame, got no file";
  plan.shards[0].samples[0].pair.motion.reset();
  complete_plan(manifest_, datasets, plan);
  EXPECT_EQ(to_json(plan), whole);
}

}  // namespace
}  // namespace eventgan
