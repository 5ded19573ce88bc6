#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>

#include "pipeline/planning/make_plan.h"
#include "tests/testing/fake_dataset.h"

namespace eventgan {
namespace {

using testing::FakeDataset;

SourceSpec source(std::vector<int> gaps, PairSide side, PairChoice choose) {
  SourceSpec spec;
  spec.dataset = DatasetKind::kKittiObject;
  spec.pairs = {.gaps = std::move(gaps), .side = side, .choose = choose};
  return spec;
}

PairChoiceResult choose(const FakeDataset& dataset, int frame, const SourceSpec& spec,
                        std::uint64_t seed = 7) {
  return choose_pairs(dataset, dataset.labelled_frames()[frame], spec, seed);
}

TEST(ChoosePairs, SideSaysWhereTheLabelledFrameLies) {
  const FakeDataset dataset("root", 20);
  const struct {
    PairSide side;
    std::int64_t previous, next;
    double position;
  } cases[] = {{PairSide::kBefore, 6, 10, 1},
               {PairSide::kAfter, 10, 14, 0},
               {PairSide::kAround, 8, 12, 0.5}};
  for (const auto& expected : cases) {
    const auto result = choose(dataset, 10, source({4}, expected.side, PairChoice::kOne));
    ASSERT_EQ(result.samples.size(), 1u);
    const PlannedSample& sample = result.samples[0];
    EXPECT_EQ(sample.pair.previous.index, expected.previous);
    EXPECT_EQ(sample.pair.next.index, expected.next);
    EXPECT_EQ(sample.pair.label_position, expected.position);
    EXPECT_EQ(sample.pair.label_index, 10);
    EXPECT_EQ(sample.pair.gap_frames, 4);
    EXPECT_NEAR(sample.pair.gap_s(), 0.4, 1e-12);
    EXPECT_EQ(sample.sample_id, "0010");
    EXPECT_EQ(sample.fault, "");
  }
}

TEST(ChoosePairs, AroundALabelledFrameItsTimeSaysWhereItLies) {
  FakeDataset dataset("root", 20);
  const auto position = [&](double labelled_s, double next_s) {
    dataset.set_time(10, labelled_s);
    dataset.set_time(11, next_s);
    return choose(dataset, 10, source({2}, PairSide::kAround, PairChoice::kOne))
        .samples[0]
        .pair.label_position;
  };
  const double nobody_knows = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NEAR(position(1.4, 1.6), 5.0 / 7, 1e-12);  // the previous frame is at 0.9 s
  EXPECT_NEAR(position(1.0, 1.3), 1.0 / 4, 1e-12);
  EXPECT_EQ(position(1.0, 1.1), 0.5);
  EXPECT_EQ(position(1.001, 1.1), 0.5);  // a clock that ticks unevenly
  EXPECT_EQ(position(nobody_knows, 1.3), 0.5);
  EXPECT_EQ(position(1.0, nobody_knows), 0.5);
  EXPECT_EQ(position(2.0, 1.3), 0.5);
}

TEST(ChoosePairs, AWindowOfEventsIsFromItsBeginToItsEnd) {
  const FakeDataset dataset("root", 20);  // its paired frames -1 and 1 stand for the window's edges
  SourceSpec spec;
  spec.dataset = DatasetKind::kRecording;
  for (const auto& [place, position] :
       {std::pair{LabelPlace::kEnd, 1.0}, {LabelPlace::kMiddle, 0.5}}) {
    spec.window.label = place;
    const auto result = choose(dataset, 10, spec);
    ASSERT_EQ(result.samples.size(), 1u);
    PlannedSample sample = result.samples[0];
    EXPECT_EQ(sample.sample_id, "0010");
    EXPECT_EQ(sample.pair.previous.index, 9);
    EXPECT_EQ(sample.pair.next.index, 11);
    EXPECT_EQ(sample.pair.gap_frames, 0);
    EXPECT_EQ(sample.pair.label_index, 10);
    EXPECT_EQ(sample.pair.label_position, position);
    EXPECT_EQ(result.unpaired.size(), 0u);
    // A frozen plan may hold no times.
    const double begin_s = sample.pair.previous.time_s;
    sample.pair.previous.time_s = 0;
    renew_sample(dataset, dataset.labelled_frames()[10], spec, sample);
    EXPECT_EQ(sample.pair.previous.time_s, begin_s);
  }
}

TEST(ChoosePairs, AllGivesEachGapAnIdOfItsOwn) {
  const FakeDataset dataset("root", 20);
  const auto result = choose(dataset, 2, source({1, 2, 3}, PairSide::kBefore, PairChoice::kAll));
  ASSERT_EQ(result.samples.size(), 2u);
  EXPECT_EQ(result.samples[0].sample_id, "0002@before1");
  EXPECT_EQ(result.samples[1].sample_id, "0002@before2");
  EXPECT_THAT(result.unpaired, ::testing::ElementsAre(3));
}

TEST(ChoosePairs, OneDrawsOnlyGapsWhoseFramesExist) {
  FakeDataset dataset("root", 20);
  dataset.make_missing(9);
  const auto spec = source({1, 2, 3, 4, 5, 6}, PairSide::kBefore, PairChoice::kOne);
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    EXPECT_NE(choose(dataset, 10, spec, seed).samples.at(0).pair.gap_frames, 1);
    EXPECT_EQ(choose(dataset, 1, spec, seed).samples.at(0).pair.gap_frames, 1);  // the only one
  }
}

TEST(ChoosePairs, DrawsEveryGapAboutEquallyOften) {
  const FakeDataset dataset("root", 3006);
  std::map<int, int> counts;
  const auto spec = source({1, 2, 6}, PairSide::kBefore, PairChoice::kOne);
  for (int frame = 6; frame < 3006; ++frame)
    ++counts[choose(dataset, frame, spec).samples[0].pair.gap_frames];
  // 3000 draws of 3: mean 1000, deviation √(3000 · 2/9) = 26; five deviations.
  for (const int gap : spec.pairs.gaps) EXPECT_NEAR(counts[gap], 1000, 130) << gap;
}

TEST(ChoosePairs, DependsOnSeedDatasetAndSampleAlone) {
  const FakeDataset dataset("root", 300), longer("elsewhere", 500);
  auto spec = source({1, 2, 3, 4, 5, 6}, PairSide::kBefore, PairChoice::kOne);
  int same = 0;
  for (int frame = 10; frame < 110; ++frame) {
    const int gap = choose(dataset, frame, spec, 7).samples[0].pair.gap_frames;
    EXPECT_EQ(choose(longer, frame, spec, 7).samples[0].pair.gap_frames, gap);
    same += choose(dataset, frame, spec, 8).samples[0].pair.gap_frames == gap;
  }
  EXPECT_LT(same, 40);  // of 100 draws of 6 about 17 agree by chance
}

TEST(ChoosePairs, BeyondTheSequenceThereIsNoPairedFrameAndNoSample) {
  const FakeDataset dataset("root", 3);
  const auto result = choose(dataset, 0, source({1, 2}, PairSide::kBefore, PairChoice::kOne));
  EXPECT_TRUE(result.samples.empty());
  EXPECT_THAT(result.unpaired, ::testing::ElementsAre(1, 2));
}

TEST(ChoosePairs, OneTellsWhichGapsCouldNotBeDrawn) {
  const FakeDataset dataset("root", 3);
  const auto result = choose(dataset, 1, source({1, 2, 4}, PairSide::kBefore, PairChoice::kOne));
  EXPECT_EQ(result.samples.size(), 1u);
  EXPECT_THAT(result.unpaired, ::testing::ElementsAre(2, 4));
}

TEST(ChoosePairs, FramesFartherApartThanAskedAreNotPaired) {
  FakeDataset dataset("root", 20);  // a frame each 0.1 s
  auto spec = source({1, 2, 3, 4}, PairSide::kBefore, PairChoice::kAll);
  for (const double most : {0.3, 0.35}) {  // 12 * 0.1 - 9 * 0.1 is 0.30000000000000016
    spec.pairs.max_gap_s = most;
    const auto result = choose(dataset, 12, spec);
    ASSERT_EQ(result.samples.size(), 3u) << most;
    EXPECT_EQ(result.samples.back().pair.gap_frames, 3);
    EXPECT_THAT(result.unpaired, ::testing::ElementsAre(4));
  }
  spec.pairs.max_gap_s = 0.05;
  EXPECT_TRUE(choose(dataset, 12, spec).samples.empty());
  dataset.make_missing(11);
  EXPECT_TRUE(choose(dataset, 12, spec).samples.empty()) << "nobody asked for that frame";
  spec.pairs.choose = PairChoice::kOne;
  EXPECT_THAT(choose(dataset, 12, spec).unpaired, ::testing::ElementsAre(1, 2, 3, 4));
}

TEST(ChoosePairs, AMissingFrameBecomesASampleThatNamesItsFile) {
  FakeDataset dataset("root", 20);
  dataset.make_missing(8);
  const auto result = choose(dataset, 10, source({2}, PairSide::kBefore, PairChoice::kOne));
  ASSERT_EQ(result.samples.size(), 1u);
  EXPECT_EQ(result.samples[0].fault, "expected a frame, got no file, in root/0008.png (0010)");
  dataset.make_missing(10);  // the labelled frame itself
  EXPECT_THAT(
      choose(dataset, 10, source({1}, PairSide::kBefore, PairChoice::kAll)).samples.at(0).fault,
      ::testing::HasSubstr("root/0010.png"));
}

TEST(ChoosePairs, AMissingFrameWhoseCounterpartIsBeyondTheEndIsNoSample) {
  FakeDataset dataset("root", 20);
  dataset.make_missing(17);
  // Around frame 18: 17 is missing, 19 there; 16 there, 20 beyond; around 19 are 17 and 21.
  for (const PairChoice choice : {PairChoice::kOne, PairChoice::kAll}) {
    const SourceSpec spec = source({2, 4}, PairSide::kAround, choice);
    EXPECT_THAT(choose(dataset, 18, spec).samples.at(0).fault, ::testing::HasSubstr("0017.png"));
    EXPECT_THAT(choose(dataset, 19, spec).samples, ::testing::IsEmpty());
    EXPECT_THAT(choose(dataset, 19, spec).unpaired, ::testing::ElementsAre(2, 4));
  }
}

TEST(ChoosePairs, AFrameAtFaultGivesThatFaultAndNoOtherDraw) {
  const FakeDataset dataset("root", 20);
  for (const PairChoice choice : {PairChoice::kOne, PairChoice::kAll}) {
    const SourceSpec spec = source({1, 2, 3, 4}, PairSide::kBefore, choice);
    LabelledFrame frame = dataset.labelled_frames()[3];  // nothing is 4 before it
    const auto sound = choose_pairs(dataset, frame, spec, 7);
    frame.fault = "expected a time, got none, in timestamps.txt";
    const auto faulty = choose_pairs(dataset, frame, spec, 7);
    EXPECT_EQ(faulty.unpaired, sound.unpaired);
    ASSERT_EQ(faulty.samples.size(), sound.samples.size());
    for (std::size_t i = 0; i < sound.samples.size(); ++i) {
      EXPECT_EQ(faulty.samples[i].fault, frame.fault);
      EXPECT_EQ(faulty.samples[i].sample_id, sound.samples[i].sample_id);
      EXPECT_EQ(faulty.samples[i].pair.gap_frames, sound.samples[i].pair.gap_frames);
    }
  }
}

// The times of a drive, say, were damaged or mended after the plan was frozen.
TEST(RenewSample, TakesKeyTimesAndFaultOfItsFrameAsTheyAre) {
  const FakeDataset dataset("root", 20);
  for (const PairSide side : {PairSide::kBefore, PairSide::kAfter, PairSide::kAround}) {
    const SourceSpec spec = source({2}, side, PairChoice::kOne);
    LabelledFrame frame = dataset.labelled_frames()[5];
    const PlannedSample today = choose_pairs(dataset, frame, spec, 7).samples.at(0);
    PlannedSample sample = today;
    sample.label_key = "another's";
    sample.pair.previous.time_s = sample.pair.next.time_s = 99;
    renew_sample(dataset, frame, spec, sample);
    EXPECT_EQ(sample.label_key, today.label_key);
    EXPECT_EQ(sample.pair.previous.time_s, today.pair.previous.time_s);
    EXPECT_EQ(sample.pair.next.time_s, today.pair.next.time_s);
    EXPECT_EQ(sample.fault, "");

    frame.fault = "expected a time, got none, in timestamps.txt";
    renew_sample(dataset, frame, spec, sample);
    EXPECT_EQ(sample.fault, frame.fault);
  }
}

}  // namespace
}  // namespace eventgan
