#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

#include "stages/training/training_batch_internal.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// 1x2 pixels, one bin; all values different.
TrainingSample sample_from(float first) {
  TrainingSample sample;
  sample.shape = {1, {1, 2}};
  sample.frames = {first, first + 1, first + 2, first + 3};
  sample.network_frames = {first + 4, first + 5, first + 6, first + 7};
  sample.volume = {0, first + 8, 0, first + 9};
  sample.origin = "desk";
  return sample;
}

TEST(TrainingBatch, KeepsSamplesFramesAndChannelsApart) {
  const std::vector<TrainingSample> samples{sample_from(0), sample_from(100)};
  const TrainingBatch batch = make_training_batch(samples, 1, c10::kCPU);
  EXPECT_EQ(batch.frames.sizes(), (at::IntArrayRef{2, 2, 1, 2}));
  EXPECT_EQ(batch.previous()[1][0][0][1].item<float>(), 101);
  EXPECT_EQ(batch.next()[0][0][0][0].item<float>(), 2);
  EXPECT_EQ(batch.network_frames[1][1][0][0].item<float>(), 106);
  EXPECT_EQ(batch.volume[0][1][0][1].item<float>(), 9);
  EXPECT_FALSE(batch.has_events()[0][0][0][0].item<bool>());
  EXPECT_TRUE(batch.has_events()[0][0][0][1].item<bool>());
}

TEST(TrainingBatch, RefusesWhatDoesNotFit) {
  EXPECT_THROW(make_training_batch({}, 1, c10::kCPU), std::invalid_argument);
  std::vector<TrainingSample> samples{sample_from(0), sample_from(1)};
  EXPECT_THROW(make_training_batch(samples, 2, c10::kCPU), std::invalid_argument);
  samples[1].volume.pop_back();
  EXPECT_THAT(
      [&] { make_training_batch(samples, 1, c10::kCPU); },
      ThrowsMessage<std::invalid_argument>(HasSubstr("expected 4 numbers, got 3, in desk")));
}

}  // namespace
}  // namespace eventgan
