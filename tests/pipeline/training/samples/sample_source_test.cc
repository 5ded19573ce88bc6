#include "pipeline/training/samples/sample_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "tests/pipeline/training/samples/fake_training_recording.h"
#include "tests/testing/fake_recording.h"

namespace eventgan {
namespace {

TrainingManifest source_manifest() {
  TrainingManifest manifest;
  manifest.seed = 5;
  manifest.crop = {16, 16};
  manifest.gaps = {1};
  manifest.batch = 4;
  manifest.network.bins = 3;
  return manifest;
}

SampleSource source_of(const TrainingManifest& manifest, const testing::FakeRecording& recording) {
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(recording));
  return SampleSource(manifest, std::move(recordings));
}

bool equal(const TrainingSample& a, const TrainingSample& b) {
  return a.shape == b.shape && a.frames == b.frames && a.network_frames == b.network_frames &&
         a.volume == b.volume && a.origin == b.origin;
}

TEST(SampleSource, ASampleDoesNotDependOnWhatWasAskedBefore) {
  const auto bar = testing::moving_bar_recording({32, 40}, 9);
  const SampleSource asked = source_of(source_manifest(), bar);
  const SampleSource fresh = source_of(source_manifest(), bar);
  for (std::int64_t step = 9; step >= 0; --step) asked.batch(TrainingPhase::kFlow, step);
  const auto batch = asked.batch(TrainingPhase::kGenerator, 7);
  ASSERT_EQ(batch.size(), 4u);
  for (int i = 3; i >= 0; --i) {
    EXPECT_TRUE(equal(batch[i], fresh.sample({TrainingPhase::kGenerator, 7, i}))) << i;
  }
}

TEST(SampleSource, GivesNormalisedVolumesOfTheCrop) {
  const SampleSource source =
      source_of(source_manifest(), testing::moving_bar_recording({32, 40}, 9));
  for (const TrainingSample& sample : source.batch(TrainingPhase::kFlow, 0)) {
    EXPECT_EQ(sample.shape, (VolumeShape{3, {16, 16}}));
    EXPECT_EQ(sample.frames.size(), 512u);
    for (const float value : sample.volume) EXPECT_TRUE(value >= 0 && value <= 1);
  }
}

TEST(SampleSource, GainChangesTheNetworksFramesOnly) {
  TrainingManifest manifest = source_manifest();
  manifest.augmentation.gain = {0.5, 0.5};
  const SampleSource source = source_of(manifest, testing::moving_bar_recording({32, 40}, 9));
  const TrainingSample sample = source.sample({TrainingPhase::kFlow, 0, 0});
  for (std::size_t i = 0; i < sample.frames.size(); ++i) {
    EXPECT_NEAR(sample.network_frames[i] + 1, (sample.frames[i] + 1) / 2, 1e-5);
  }
}

TEST(SampleSource, StaticPairsAreEmptyAndEqual) {
  TrainingManifest manifest = source_manifest();
  manifest.augmentation.static_fraction = 1;
  const SampleSource source = source_of(manifest, testing::moving_bar_recording({32, 40}, 9));
  for (const TrainingSample& sample : source.batch(TrainingPhase::kFlow, 0)) {
    EXPECT_EQ(std::accumulate(sample.volume.begin(), sample.volume.end(), 0.0f), 0);
    EXPECT_TRUE(std::equal(sample.frames.begin(), sample.frames.begin() + 256,
                           sample.frames.begin() + 256));
  }
}

TEST(SampleSource, DrawsAgainWhereHardlyAnythingMoved) {
  // Ten frames, events in the last interval only: 200 of them at one pixel.
  const GreyImage grey{{16, 16}, std::vector<std::uint8_t>(256, 100)};
  std::vector<double> times(10);
  std::iota(times.begin(), times.end(), 0.0);
  const testing::FakeRecording recording(std::vector<GreyImage>(10, grey), times,
                                         std::vector<Event>(200, {3, 4, 8.5, true}));
  const SampleSource source = source_of(source_manifest(), recording);
  int busy = 0;
  for (int i = 0; i < 200; ++i) {
    const TrainingSample sample = source.sample({TrainingPhase::kFlow, i, 0});
    busy += sample.origin.find("frames 8-9") != std::string::npos;
  }
  // Of ten attempts one hits with probability 1 - (8/9)^10 = 0.69, not 1/9; five sigma is 0.16.
  EXPECT_NEAR(busy / 200.0, 0.69, 0.17);
}

TEST(SampleSource, EndsWhereNothingEverMoves) {
  const GreyImage grey{{16, 16}, std::vector<std::uint8_t>(256, 100)};
  const SampleSource source =
      source_of(source_manifest(), testing::FakeRecording({grey, grey}, {0, 1}, {}));
  const TrainingSample sample = source.sample({TrainingPhase::kFlow, 0, 0});
  EXPECT_EQ(std::accumulate(sample.volume.begin(), sample.volume.end(), 0.0f), 0);
}

}  // namespace
}  // namespace eventgan
