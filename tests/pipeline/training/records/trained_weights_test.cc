#include "pipeline/training/records/trained_weights.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "stages/files/sha256.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/training/trainer.h"
#include "tests/pipeline/training/small_training.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

TEST(TrainedWeights, RunAndSayWhereTheyComeFrom) {
  const testing::TemporaryFolder folder;
  for (const char* place : {"decoders", "encoders", "none"}) {
    const TrainingManifest manifest =
        testing::small_training(folder.path(), "\"bins\": 3",
                                "\"bins\": 3, \"spectral_norm\": \"" + std::string(place) + "\"");
    Weights weights = trained_weights(Trainer(manifest, "cpu").generator_state(), manifest,
                                      {TrainingPhase::kGenerator, 3});
    EXPECT_EQ(weights.metadata.at("origin"), "eventgan train");
    const auto [first, last] = std::ranges::minmax(manifest.gaps);
    EXPECT_EQ(weights.training_gaps, (GapRange{first, last}));
    EXPECT_EQ(weights.metadata.at("training_manifest"), manifest.text);
    EXPECT_EQ(weights.metadata.at("training_manifest_sha256"), sha256_hex(manifest.text));
    EXPECT_EQ(weights.metadata.at("training_steps"), "flow 2, reconstruction 2, generator 3");
    EXPECT_EQ(make_torch_generator(weights)->bins(), 3) << place;

    const auto recordings =
        open_training_recordings(manifest.recordings, manifest.directory, manifest.crop, 1);
    add_final_origin(weights, manifest, recordings, {{"volume", 0.25}});
    EXPECT_EQ(weights.metadata.at("training_recordings_sha256"),
              "bar.hdf5\t" + sha256_of_file(folder / "bar.hdf5") + "\n");
    EXPECT_EQ(weights.metadata.at("training_losses"), "volume\t0.25\n");
  }
}

TEST(TrainedWeights, EqualTheTrainersGenerator) {
  const testing::TemporaryFolder folder;
  const TrainingManifest manifest = testing::small_training(folder.path());
  const Trainer trainer(manifest, "cpu");
  TrainingSample sample;
  sample.shape = {3, {19, 23}};
  for (std::size_t i = 0; i < 2 * sample.shape.size.pixel_count(); ++i) {
    sample.network_frames.push_back(static_cast<float>(i % 17) / 8.5f - 1);
  }
  sample.frames = sample.network_frames;
  const std::vector<float> expected = trainer.generate(sample);
  const Weights weights =
      trained_weights(trainer.generator_state(), manifest, {TrainingPhase::kGenerator, 0});
  std::vector<float> volume(sample.shape.value_count());
  make_torch_generator(weights)->generate(sample.network_frames, sample.shape.size, volume);
  ASSERT_EQ(volume.size(), expected.size());
  const float largest = *std::max_element(expected.begin(), expected.end());
  ASSERT_GT(largest, 0);
  for (std::size_t i = 0; i < volume.size(); ++i) {
    EXPECT_NEAR(volume[i], expected[i], 1e-4f * largest) << i;
  }
}

TEST(TrainedWeights, RefuseAStateThatIsNoGenerators) {
  const testing::TemporaryFolder folder;
  EXPECT_THROW(trained_weights({}, testing::small_training(folder.path()), {}), std::runtime_error);
}

}  // namespace
}  // namespace eventgan
