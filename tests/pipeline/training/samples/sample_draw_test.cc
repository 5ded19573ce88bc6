#include "pipeline/training/samples/sample_draw.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "tests/pipeline/training/samples/fake_training_recording.h"
#include "tests/testing/fake_recording.h"

namespace eventgan {
namespace {

constexpr int kDraws = 4000;

TrainingManifest drawing_manifest() {
  TrainingManifest manifest;
  manifest.seed = 11;
  manifest.crop = {16, 16};
  manifest.gaps = {1, 3};
  return manifest;
}

std::vector<TrainingRecording> long_and_short() {
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(testing::moving_bar_recording({20, 30}, 9), 3));
  recordings.push_back(testing::opened(testing::moving_bar_recording({16, 16}, 3), 1));
  return recordings;
}

SampleDraw draw(const std::vector<TrainingRecording>& recordings, const TrainingManifest& manifest,
                std::int64_t step, int index = 0, int attempt = 0) {
  return draw_sample(recordings, manifest, {TrainingPhase::kGenerator, step, index}, attempt);
}

bool same(const SampleDraw& a, const SampleDraw& b) {
  return a.recording == b.recording && a.first_frame == b.first_frame &&
         a.last_frame == b.last_frame && a.augmentation.top == b.augmentation.top &&
         a.augmentation.left == b.augmentation.left &&
         a.augmentation.flip_x == b.augmentation.flip_x &&
         a.augmentation.flip_y == b.augmentation.flip_y;
}

TEST(DrawSample, DependsOnSeedAndPlaceAlone) {
  const auto recordings = long_and_short();
  TrainingManifest manifest = drawing_manifest();
  int differ_by_index = 0, differ_by_phase = 0, differ_by_seed = 0;
  TrainingManifest other = manifest;
  other.seed = 12;
  for (std::int64_t step = 0; step < 50; ++step) {
    const SampleDraw first = draw(recordings, manifest, step);
    EXPECT_TRUE(same(first, draw(recordings, manifest, step)));
    differ_by_index += !same(first, draw(recordings, manifest, step, 1));
    differ_by_seed += !same(first, draw(recordings, other, step));
    differ_by_phase +=
        !same(first, draw_sample(recordings, manifest, {TrainingPhase::kFlow, step, 0}, 0));
  }
  EXPECT_GT(differ_by_index, 40);
  EXPECT_GT(differ_by_phase, 40);
  EXPECT_GT(differ_by_seed, 40);
}

TEST(DrawSample, TakesRecordingsByWeight) {
  const auto recordings = long_and_short();
  int first = 0;
  for (int i = 0; i < kDraws; ++i) first += draw(recordings, drawing_manifest(), i).recording == 0;
  // Binomial with p = 3/4: five standard deviations.
  EXPECT_NEAR(first, 0.75 * kDraws, 5 * std::sqrt(kDraws * 0.75 * 0.25));
}

TEST(DrawSample, TakesGapsThatFitAndFramesInUse) {
  auto recordings = long_and_short();
  recordings[0].first_frame = 2;
  recordings[0].last_frame = 7;
  std::map<std::int64_t, int> gaps, first_frames;
  for (int i = 0; i < kDraws; ++i) {
    const SampleDraw drawn = draw(recordings, drawing_manifest(), i);
    const std::int64_t gap = drawn.last_frame - drawn.first_frame;
    if (drawn.recording == 1) {
      ASSERT_EQ(gap, 1);  // three frames: a gap of 3 does not fit
      ASSERT_LE(drawn.last_frame, 2);
      continue;
    }
    ASSERT_GE(drawn.first_frame, 2);
    ASSERT_LE(drawn.last_frame, 7);
    ++gaps[gap];
    if (gap == 3) ++first_frames[drawn.first_frame];
  }
  ASSERT_EQ(gaps.size(), 2u);
  EXPECT_NEAR(gaps[1], gaps[3], 5 * std::sqrt(kDraws * 0.75));
  // A gap of 3 within frames 2..7 begins at 2, 3 or 4, each as likely.
  ASSERT_EQ(first_frames.size(), 3u);
  for (const auto& [frame, count] : first_frames) EXPECT_NEAR(count, gaps[3] / 3.0, 150) << frame;
}

TEST(DrawSample, TakesOneFrameTwiceForTheStaticShare) {
  const auto recordings = long_and_short();
  TrainingManifest manifest = drawing_manifest();
  for (const double share : {0.0, 0.25, 1.0}) {
    manifest.augmentation.static_fraction = share;
    int still = 0;
    for (int i = 0; i < kDraws; ++i) {
      const SampleDraw drawn = draw(recordings, manifest, i);
      still += drawn.first_frame == drawn.last_frame;
    }
    EXPECT_NEAR(still, share * kDraws, 5 * std::sqrt(kDraws * share * (1 - share)));
  }
}

TEST(DrawSample, AnotherAttemptKeepsTheRecording) {
  const auto recordings = long_and_short();
  int moved = 0;
  for (int i = 0; i < 100; ++i) {
    const SampleDraw first = draw(recordings, drawing_manifest(), i);
    const SampleDraw second = draw(recordings, drawing_manifest(), i, 0, 1);
    EXPECT_EQ(first.recording, second.recording);
    moved += !same(first, second);
  }
  EXPECT_GT(moved, 50);
}

TEST(DrawSample, RefusesNothingToDrawFrom) {
  EXPECT_THROW(draw({}, drawing_manifest(), 0), std::invalid_argument);
}

}  // namespace
}  // namespace eventgan
