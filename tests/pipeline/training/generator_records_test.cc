#include "pipeline/training/generator_records.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "manifests/files/sha256.h"
#include "stages/events/simulation/moving_planes.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights_file.h"
#include "stages/training/trainer.h"
#include "tests/pipeline/training/bar_training.h"
#include "tests/pipeline/training/fake_training_recording.h"
#include "tests/testing/fake_generator.h"
#include "tests/testing/fake_recording.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

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
    add_final_origin(weights, manifest, training_settings(manifest, recordings),
                     {{"volume", 0.25}});
    EXPECT_EQ(weights.metadata.at("training_recordings_sha256"),
              "bar.hdf5\t" + sha256_of_file(folder / "bar.hdf5") + "\n");
    EXPECT_EQ(weights.metadata.at("training_losses"), "volume\t0.25\n");
    EXPECT_FALSE(weights.metadata.contains("training_teacher_sha256"));
  }
}

TEST(TrainedWeights, SayWhichTexturesTheySaw) {
  const testing::TemporaryFolder folder;
  TrainingManifest manifest = testing::small_training(folder.path());
  manifest.simulated = SimulatedSpec{{"textures", "textures/b"}, 0.5};
  testing::write_file(folder / "textures/b/c.png", "1");
  testing::write_file(folder / "textures/a.png", "2");
  Weights weights;
  const auto recordings =
      open_training_recordings(manifest.recordings, manifest.directory, manifest.crop, 1);
  add_final_origin(weights, manifest, training_settings(manifest, recordings), {});
  const std::string c = "c.png\t" + sha256_hex("1") + "\n";
  const std::string all = "a.png\t" + sha256_hex("2") + "\nb/" + c;
  EXPECT_EQ(weights.metadata.at("training_textures_sha256"),
            "textures\t" + sha256_hex(all) + "\ntextures/b\t" + sha256_hex(c) + "\n");
}

TEST(TrainedWeights, SayWhoTaughtThem) {
  const testing::TemporaryFolder folder;
  TrainingManifest manifest = testing::small_training(folder.path());
  manifest.teacher = "bar.hdf5";  // any file
  Weights weights;
  const auto recordings =
      open_training_recordings(manifest.recordings, manifest.directory, manifest.crop, 1);
  add_final_origin(weights, manifest, training_settings(manifest, recordings), {});
  EXPECT_EQ(weights.metadata.at("training_teacher_sha256"), sha256_of_file(folder / "bar.hdf5"));
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
  // TrainedGenerator (trainer_test.cc) compares the folded generator with the trainer's network.
  const Weights folded = fold_generator(trainer.generator_state(), "the trained generator", {});
  const std::vector<float> expected = generated_volume(*make_torch_generator(folded), sample);
  ASSERT_GT(*std::max_element(expected.begin(), expected.end()), 0);
  const Weights weights =
      trained_weights(trainer.generator_state(), manifest, {TrainingPhase::kGenerator, 0});
  EXPECT_EQ(generated_volume(*make_torch_generator(weights), sample), expected);
}

/// A training of a network that knows its sensor, of thresholds 0.2 and 0.5 in the mean.
TrainingManifest sensor_training(const std::filesystem::path& folder) {
  TrainingManifest manifest = testing::small_training(folder);
  manifest.network.sensor = true;
  manifest.recordings.push_back(manifest.recordings[0]);
  manifest.recordings[0].threshold = ContrastThreshold{0.5};
  manifest.recordings[1].threshold = ContrastThreshold{0.2, 4};  // 0.1 and 0.4
  return manifest;
}

TEST(TrainedWeights, SayWhichThresholdsTheyLearnt) {
  const testing::TemporaryFolder folder;
  TrainingManifest manifest = sensor_training(folder.path());
  const StateDict state = Trainer(manifest, "cpu").generator_state();
  const auto learnt = [&] {
    return trained_weights(state, manifest, {TrainingPhase::kGenerator, 0}).thresholds.value();
  };
  EXPECT_EQ(learnt(), (ThresholdRange{0.1, 0.5}));
  // Gamma turns a threshold into one of as much more or less contrast.
  manifest.augmentation.gamma = {0.75, 1.5};
  EXPECT_DOUBLE_EQ(learnt().lowest, 0.075);
  EXPECT_DOUBLE_EQ(learnt().highest, 0.75);
  manifest.simulated = SimulatedSpec{{"textures"}, 0.5};
  EXPECT_EQ(learnt(), kPlaneThresholds) << "wider on either side";
  manifest.augmentation.gamma = {0.1, 10};
  EXPECT_DOUBLE_EQ(learnt().lowest, 0.01);
  EXPECT_DOUBLE_EQ(learnt().highest, 5);

  const Weights weights = trained_weights(state, manifest, {TrainingPhase::kGenerator, 0});
  EXPECT_EQ(parse_weights(serialize_weights(weights), "NAME").thresholds, weights.thresholds);
  EXPECT_EQ(make_torch_generator(weights)->thresholds(), weights.thresholds);
}

TEST(TrainedWeights, HaveNoThresholdsUnlessTheNetworkKnowsItsSensor) {
  const testing::TemporaryFolder folder;
  const TrainingManifest manifest = testing::small_training(folder.path());
  const StateDict state = Trainer(manifest, "cpu").generator_state();
  EXPECT_EQ(trained_weights(state, manifest, {}).thresholds, std::nullopt);
  EXPECT_THROWS(trained_weights(state, sensor_training(folder.path()), {}), std::runtime_error,
                "expected a generator of 3 inputs to 2 x bins channels")
      << "two inputs";
  EXPECT_THROWS(trained_weights({}, testing::small_training(folder.path()), {}), std::runtime_error,
                "expected key head.conv2d.weight, got none, in the trained");
}

CropReader reader_of(std::vector<int> frame_counts) {
  std::vector<TrainingRecording> recordings;
  for (const int count : frame_counts) {
    recordings.push_back(testing::opened(testing::moving_bar_recording({24, 32}, count)));
  }
  return CropReader(std::move(recordings), 3);
}

TEST(ValidationPairs, AreConsecutiveFramesInTheMiddle) {
  const CropReader reader = reader_of({3, 2});
  const ValidationPairs pairs(reader, {16, 16});
  ASSERT_EQ(pairs.samples().size(), 3u);
  EXPECT_EQ(pairs.samples()[0].origin, "fake recording frames 0-1 crop 8,4");
  EXPECT_EQ(pairs.samples()[1].origin, "fake recording frames 1-2 crop 8,4");
  EXPECT_EQ(pairs.samples()[2].origin, "fake recording frames 0-1 crop 8,4");
}

TEST(ValidationPairs, AreSpreadEvenlyWhereThereAreMany) {
  const CropReader reader = reader_of({33});
  const ValidationPairs pairs(reader, {100, 100});  // larger than the image: all of it
  ASSERT_EQ(pairs.samples().size(), 16u);
  for (int i = 0; i < 16; ++i) {
    EXPECT_EQ(pairs.samples()[i].origin, "fake recording frames " + std::to_string(2 * i) + "-" +
                                             std::to_string(2 * i + 1) + " crop 0,0");
  }
}

TEST(ValidationPairs, AreJudgedByTheirMeans) {
  const CropReader reader = reader_of({3});
  const ValidationPairs pairs(reader, {24, 32});
  const testing::FakeGenerator generator(3);
  const ValidationScores scores = pairs.judge(generator);
  EXPECT_EQ(generator.calls(), 2);
  // The bar's columns that change have events, and the fake generator's volume is not zero where
  // the frames differ: the same pixels, the same polarity.
  EXPECT_DOUBLE_EQ(scores.realism.f1_time, 1);
  EXPECT_GT(scores.volume_loss, 0);
}

TEST(ValidationPairs, TellTheirThresholdAndJudgeCounts) {
  std::vector<TrainingRecording> recordings;
  recordings.push_back(testing::opened(testing::moving_bar_recording({24, 32}, 3)));
  recordings[0].threshold = ContrastThreshold{0.25};
  const CropReader reader(std::move(recordings), 3);
  const ValidationPairs pairs(reader, {24, 32});
  testing::FakeGenerator generator(3);
  generator.know({0.1, 0.4});
  const ValidationScores scores = pairs.judge(generator);
  EXPECT_EQ(generator.threshold(), 0.25);
  EXPECT_DOUBLE_EQ(scores.realism.f1_time, 1);  // as AreJudgedByTheirMeans
  EXPECT_GT(scores.volume_loss, 0);
}

TEST(ValidationLog, GoesOnAfterTheCheckpoint) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "validation.csv";
  ValidationScores scores;
  scores.volume_loss = 0.5;
  {
    ValidationLog log(file, -1);
    for (const int step : {10, 20, 30}) log.add(step, scores);
  }
  ValidationLog log(file, 20);
  scores.volume_loss = 0.25;
  log.add(25, scores);
  const std::string text = testing::read_file(file);
  EXPECT_NE(text.find("\n20,0.5,"), std::string::npos);
  EXPECT_NE(text.find("\n25,0.25,"), std::string::npos);
  EXPECT_EQ(text.find("\n30,"), std::string::npos);
}

}  // namespace
}  // namespace eventgan
