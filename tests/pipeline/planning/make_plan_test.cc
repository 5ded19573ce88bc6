#include "pipeline/planning/make_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/testing/picture_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

class MakePlan : public ::testing::Test {
 protected:
  MakePlan() {
    manifest_.name = "job";
    manifest_.text = "{}";
    manifest_.directory = folder_.path();
    manifest_.output.samples_per_shard = 2;
    for (const char* name : {"f_00.png", "f_01.png", "f_02.png", "f_03.png"}) {
      testing::write_flat_picture(folder_ / "clip" / name, {4, 6}, 100);
    }
    SourceSpec source;
    source.dataset = DatasetKind::kFrames;
    source.root = "clip";
    source.pairs = {{1}, PairSide::kBefore, PairChoice::kOne, 1};
    manifest_.sources = {source};
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
};

TEST_F(MakePlan, CountsFramesPairsAndWhatHasNoPartner) {
  const Plan plan = make_plan(manifest_, "w", "e").plan;
  EXPECT_EQ(plan.sample_count(), 3);
  ASSERT_EQ(plan.sources.size(), 1u);
  EXPECT_EQ(plan.sources[0].labelled_frames, 4);
  EXPECT_EQ(plan.sources[0].without_partner, 1);
  EXPECT_EQ(plan.sources[0].without_partner_ids.size(), 1u);
  EXPECT_EQ(plan.sources[0].pairs_by_gap.at(1), 3);
  EXPECT_EQ(plan.shards.size(), 2u);
}

TEST_F(MakePlan, KeepsTheSourcesSizeUnlessOneIsGiven) {
  EXPECT_EQ(make_plan(manifest_, "w", "e").plan.shards[0].volume_size, (ImageSize{4, 6}));
  manifest_.image.size = ImageSize{16, 20};
  EXPECT_EQ(make_plan(manifest_, "w", "e").plan.shards[0].volume_size, (ImageSize{16, 20}));
}

TEST_F(MakePlan, GroupsPicturesBySize) {
  testing::write_flat_picture(folder_ / "clip" / "f_03.png", {8, 6}, 100);
  const Plan plan = make_plan(manifest_, "w", "e").plan;
  ASSERT_EQ(plan.shards.size(), 2u);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{8, 6}));
}

TEST_F(MakePlan, SaysWhichSamplesHaveNoKnownSizeAndFindsItOnceTheyAreMended) {
  for (const char* name : {"f_02.png", "f_03.png"}) {
    testing::write_file(folder_ / "clip" / name, "not a picture");
  }
  auto [plan, datasets] = make_plan(manifest_, "w", "e");
  ASSERT_EQ(plan.shards.size(), 2u);  // of the pairs 0-1 and 1-2, and of 2-3
  EXPECT_TRUE(plan.shards[1].size_unknown);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{4, 6}));
  const std::string& id = plan.shards[1].samples.at(0).sample_id;
  EXPECT_THAT(plan.sources[0].notes,
              ::testing::ElementsAre(::testing::AllOf(::testing::HasSubstr("size of 1 sample,"),
                                                      ::testing::HasSubstr("(" + id + ")"),
                                                      ::testing::HasSubstr("eventgan retry"))));
  complete_plan(manifest_, datasets, plan);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{4, 6})) << "the guess stays";
  testing::write_flat_picture(folder_ / "clip" / "f_03.png", {8, 10}, 100);
  complete_plan(manifest_, datasets, plan);
  EXPECT_EQ(plan.shards[1].volume_size, (ImageSize{8, 10}));
  EXPECT_EQ(plan.shards[0].volume_size, (ImageSize{4, 6}));
}

TEST_F(MakePlan, AHoleThatWasFilledBecomesWhatItWouldBePlannedAsToday) {
  for (const PairChoice choice : {PairChoice::kOne, PairChoice::kAll}) {
    manifest_.sources[0].pairs.choose = choice;
    const Plan whole = make_plan(manifest_, "w", "e").plan;
    const PlannedSample& meant = whole.shards[0].samples.at(1);  // of f_01 and f_02
    const std::string picture = testing::read_file(folder_ / "clip" / "f_01.png");
    std::filesystem::remove(folder_ / "clip" / "f_01.png");
    auto [plan, datasets] = make_plan(manifest_, "w", "e");
    const PlannedSample& hole = plan.shards.at(0).samples.at(0);
    ASSERT_EQ(hole.sample_id, meant.sample_id);
    const std::string before = to_json(plan);
    complete_plan(manifest_, datasets, plan);
    EXPECT_EQ(to_json(plan), before) << "a hole still";
    EXPECT_THAT(hole.fault, ::testing::HasSubstr("got no file"));

    testing::write_file(folder_ / "clip" / "f_01.png", picture);
    complete_plan(manifest_, make_plan(manifest_, "w", "e").datasets, plan);
    EXPECT_EQ(hole.fault, "");
    EXPECT_EQ(hole.pair.previous.path, meant.pair.previous.path);
    EXPECT_EQ(hole.pair.next.path, meant.pair.next.path);
    EXPECT_EQ(plan.sample_count(), 2);
  }
}

TEST_F(MakePlan, ALabelThatHasMovedWithinItsFileIsFoundByItsFrame) {
  for (const PairChoice choice : {PairChoice::kOne, PairChoice::kAll}) {
    manifest_.sources[0].pairs.choose = choice;
    testing::write_file(folder_ / "clip" / "f_01.json", "{}");
    auto [plan, datasets] = make_plan(manifest_, "w", "e");
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

TEST_F(MakePlan, StopsAtAnyFrameOrFile) {
  int asked = 0;
  make_plan(manifest_, "w", "e", [&] {
    ++asked;
    return false;
  });
  EXPECT_EQ(asked, 4 + 4);
  for (int last = 1; last <= 8; ++last) {
    asked = 0;
    EXPECT_THROW(make_plan(manifest_, "w", "e", [&] { return ++asked == last; }), Stopped);
    EXPECT_EQ(asked, last);
  }
}

TEST_F(MakePlan, TooFewPairsAreAnError) {
  manifest_.sources[0].pairs.min_pairs = 4;
  EXPECT_THAT([&] { make_plan(manifest_, "w", "e"); },
              ::testing::ThrowsMessage<InputError>(
                  ::testing::HasSubstr("got 3 of 4 labelled frames, in clip")));
}

TEST_F(MakePlan, AddingASourceDoesNotMoveThePairsOfAnother) {
  manifest_.sources[0].pairs.gaps = {1, 2, 3};
  const Plan alone = make_plan(manifest_, "w", "e").plan;
  for (const char* name : {"g_1.png", "g_2.png", "g_3.png"}) {
    testing::write_flat_picture(folder_ / "other" / name, {4, 6}, 100);
  }
  SourceSpec other = manifest_.sources[0];
  other.root = "other";
  manifest_.sources.insert(manifest_.sources.begin(), other);
  const Plan both = make_plan(manifest_, "w", "e").plan;
  std::vector<int> before, after;
  for (const auto& shard : alone.shards) {
    for (const auto& sample : shard.samples) before.push_back(sample.pair.gap_frames);
  }
  for (const auto& shard : both.shards) {
    if (shard.source != 1) continue;
    for (const auto& sample : shard.samples) after.push_back(sample.pair.gap_frames);
  }
  EXPECT_EQ(before, after);
}

}  // namespace
}  // namespace eventgan
