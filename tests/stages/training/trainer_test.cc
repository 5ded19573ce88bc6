#include "stages/training/trainer.h"

#include <ATen/core/grad_mode.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <torch/cuda.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "manifests/values/faults.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/training/detail/training_batch.h"
#include "stages/training/detail/training_networks.h"
#include "stages/training/networks/detail/network_state.h"
#include "tests/stages/training/small_training.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(CheckTrainable, RefusesCropsAndBatchesTooSmall) {
  TrainingManifest manifest = testing::small_training();
  EXPECT_NO_THROW(check_trainable(manifest));
  manifest.crop = {47, 48};
  EXPECT_THROWS(check_trainable(manifest), UsageError,
                "expected a crop of at least 48 pixels a side for the");
  manifest.crop = {48, 47};
  EXPECT_THROWS(check_trainable(manifest), UsageError,
                "expected a crop of at least 48 pixels a side for the");
  manifest.losses.adversarial = 0;
  EXPECT_NO_THROW(check_trainable(manifest));
  manifest = testing::small_training();
  manifest.batch = 3;
  EXPECT_THROWS(check_trainable(manifest), UsageError,
                "expected an even batch for the adversarial loss, got 3");
  manifest.losses.adversarial = 0;
  EXPECT_NO_THROW(check_trainable(manifest));
  manifest = testing::small_training();
  manifest.losses.adversarial = 0;
  manifest.crop = {16, 16};
  EXPECT_NO_THROW(check_trainable(manifest));
  manifest.batch = 1;
  EXPECT_THROWS(check_trainable(manifest), UsageError,
                "expected a batch of at least 2 for a crop of 16x16, got 1");
  manifest.crop = {17, 16};
  EXPECT_NO_THROW(check_trainable(manifest));
}

TEST(CheckTrainable, RefusesAGeneratorWithoutLoss) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses = {.adversarial = 0, .flow = 0, .reconstruction = 0};
  EXPECT_THROWS(check_trainable(manifest), UsageError,
                "expected a loss for the generator, got weight 0 for all");
  manifest.losses.likelihood = 1;
  EXPECT_NO_THROW(check_trainable(manifest));
  manifest.losses.likelihood = 0;
  manifest.steps.generator = 0;
  EXPECT_NO_THROW(check_trainable(manifest));
}

TEST(LearningRate, FallsByHalfACosineAndStaysAtItsEnd) {
  // Half way: (1 + cos(π/2)) / 2 = 1/2, so f + (1 - f) / 2; at a third: cos(π/3) = 1/2, so 3/4.
  EXPECT_DOUBLE_EQ(learning_rate(2e-4, 0.1, 0, 300), 2e-4);
  EXPECT_DOUBLE_EQ(learning_rate(2e-4, 0.1, 100, 300), 2e-4 * (0.1 + 0.9 * 0.75));
  EXPECT_DOUBLE_EQ(learning_rate(2e-4, 0.1, 150, 300), 2e-4 * 0.55);
  EXPECT_DOUBLE_EQ(learning_rate(2e-4, 0.1, 300, 300), 2e-4 * 0.1);
  EXPECT_DOUBLE_EQ(learning_rate(1, 0.25, 1000, 300), 0.25);
  EXPECT_DOUBLE_EQ(learning_rate(1, 0.25, 0, 0), 0.25);
  EXPECT_DOUBLE_EQ(learning_rate(1, 0, 7, 5), 0);
}

TEST(Faded, FallsToNothingOnALine) {
  EXPECT_DOUBLE_EQ(faded(0.1, 0, 150), 0.1);
  EXPECT_DOUBLE_EQ(faded(0.1, 75, 150), 0.05);
  EXPECT_DOUBLE_EQ(faded(0.1, 150, 150), 0);
  EXPECT_DOUBLE_EQ(faded(0.1, 299, 150), 0);
  EXPECT_DOUBLE_EQ(faded(0.1, 0, 0), 0);
}

TEST(LearningRate, IsConstantAtFractionOne) {
  for (const int step : {0, 1, 49, 50, 51}) EXPECT_DOUBLE_EQ(learning_rate(3, 1, step, 50), 3);
}

TEST(TrainingDevice, IsWhatLibTorchHas) {
  EXPECT_TRUE(training_device("cpu").is_cpu());
  EXPECT_THROWS(training_device("tpu"), UsageError,
                "expected the device \"cpu\" or \"cuda\", got \"tpu\"");
  EXPECT_THROWS(training_device(""), UsageError,
                "expected the device \"cpu\" or \"cuda\", got \"\"");
  if (torch::cuda::is_available()) {
    EXPECT_TRUE(training_device("cuda").is_cuda());
  } else {
    EXPECT_THROWS(training_device("cuda"), UsageError,
                  "expected the device \"cpu\", got \"cuda\", which this");
  }
  EXPECT_THROWS(Trainer(testing::small_training(), "tpu"), UsageError,
                "expected the device \"cpu\" or \"cuda\", got \"tpu\"");
}

constexpr TrainingPhase kPhases[] = {TrainingPhase::kFlow, TrainingPhase::kReconstruction,
                                     TrainingPhase::kGenerator};

/// First parts of the keys ("generator", "optimizer.flow") of what differs between two states.
std::set<std::string> changed_parts(const StateDict& before, const StateDict& after) {
  std::set<std::string> parts;
  for (const auto& [key, tensor] : after) {
    const bool optimizer = key.starts_with("optimizer.");
    const auto end = key.find('.', optimizer ? 10 : 0);
    if (before.at(key).values != tensor.values) parts.insert(key.substr(0, end));
  }
  return parts;
}

TEST(Trainer, AStepChangesOneNetworkAlone) {
  const TrainingManifest manifest = testing::small_training();
  Trainer trainer(manifest, "cpu");
  const auto parts = [&](TrainingPhase phase, std::int64_t step) {
    const StateDict before = trainer.state();
    trainer.step(phase, step, testing::edge_batch(manifest, 1));
    return changed_parts(before, trainer.state());
  };
  EXPECT_THAT(parts(TrainingPhase::kFlow, 0), ElementsAre("flow", "optimizer.flow"));
  EXPECT_THAT(parts(TrainingPhase::kReconstruction, 0),
              ElementsAre("optimizer.reconstruction", "reconstruction"));
  EXPECT_THAT(parts(TrainingPhase::kGenerator, 2), ElementsAre("generator", "optimizer.generator"));
  // The generator's batch norm and spectral norm move with the fakes it makes, nothing else of it.
  const StateDict before = trainer.state();
  EXPECT_THAT(parts(TrainingPhase::kGenerator, 0),
              ElementsAre("discriminator", "generator", "optimizer.discriminator"));
  const StateDict after = trainer.state();
  for (const auto& [key, tensor] : after) {
    if (!key.starts_with("generator.") || key.find("running") != std::string::npos ||
        key.find("num_batches") != std::string::npos || key.ends_with("_u") ||
        key.ends_with("_v")) {
      continue;
    }
    EXPECT_EQ(before.at(key).values, tensor.values) << key;
  }
}

TEST(Trainer, ALossThatIsNotFiniteNamesItsSamplesAndChangesNothing) {
  const TrainingManifest manifest = testing::small_training();
  Trainer trainer(manifest, "cpu");
  auto batch = testing::edge_batch(manifest, 1);
  for (const auto phase : kPhases) trainer.step(phase, 0, batch);  // so that moments are there
  std::fill(batch[3].frames.begin(), batch[3].frames.end(), NAN);
  batch[3].network_frames = batch[3].frames;
  std::fill(batch[3].volume.begin(), batch[3].volume.end(), NAN);
  const StateDict before = trainer.state();
  for (const auto phase : kPhases) {
    for (const std::int64_t step : {1, 2}) {
      try {
        trainer.step(phase, step, batch);
        FAIL() << to_string(phase);
      } catch (const UnsoundLoss& error) {
        EXPECT_THAT(error.what(), HasSubstr("edge 1.3"));
        EXPECT_THAT(error.what(), HasSubstr("step " + std::to_string(step)));
      }
      EXPECT_THAT(changed_parts(before, trainer.state()), ElementsAre());
    }
  }
}

TEST(Trainer, AnInfiniteLossIsUnsoundToo) {
  TrainingManifest manifest = testing::small_training();
  Trainer trainer(manifest, "cpu");
  auto batch = testing::edge_batch(manifest, 1);
  batch[0].volume[5] = std::numeric_limits<float>::infinity();
  EXPECT_THROWS(trainer.step(TrainingPhase::kGenerator, 2, batch), UnsoundLoss,
                "expected finite losses, got ");
}

/// With these weights of the volume loss a gradient of more than float32's 3e38, or one whose
/// square is.
class UnsoundGradient : public ::testing::TestWithParam<double> {};

TEST_P(UnsoundGradient, ChangesNothing) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses = {.adversarial = 0, .flow = 0, .reconstruction = 0, .volume = GetParam()};
  Trainer trainer(manifest, "cpu");
  // Features of 1e6 that the last layer multiplies by 0, and a volume of 1 from its bias: a loss
  // near the weight, but a gradient of the 0 near 1e6 times that.
  StateDict before = trainer.state();
  const auto set = [&](const std::string& key, float value) {
    std::fill(before.at(key).values.begin(), before.at(key).values.end(), value);
  };
  set("generator.decoders.3.norm_layer.bias", 1e6f);
  set("generator.pred.conv2d.weight", 0);
  set("generator.pred.conv2d.bias", 1);
  trainer.load(before);
  try {
    trainer.step(TrainingPhase::kGenerator, 0, testing::edge_batch(manifest, 1));
    FAIL();
  } catch (const UnsoundLoss& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("gradients"), HasSubstr("edge 1.3")));
  }
  EXPECT_THAT(changed_parts(before, trainer.state()), ElementsAre());
}

INSTANTIATE_TEST_SUITE_P(Trainer, UnsoundGradient, ::testing::Values(1e37, 1e20));

TEST(Trainer, ATermOfWeightZeroIsNotComputed) {
  const auto names = [](LossWeights weights) {
    TrainingManifest manifest = testing::small_training();
    manifest.losses = weights;
    Trainer trainer(manifest, "cpu");
    std::vector<std::string> keys;
    for (const auto& [name, value] :
         trainer.step(TrainingPhase::kGenerator, 2, testing::edge_batch(manifest, 1))) {
      keys.push_back(name);
    }
    return keys;
  };
  EXPECT_THAT(names({1, 1, 1, 1, 1, 1}),
              ElementsAre("count", "flow", "flow.photometric", "flow.smoothness", "generator",
                          "generator.total", "overlap", "reconstruction", "volume"));
  EXPECT_THAT(names({1, 0, 1, 0}), ElementsAre("generator", "generator.total", "reconstruction"));
  EXPECT_THAT(names({1, 1, 0, 0}), ElementsAre("flow", "flow.photometric", "flow.smoothness",
                                               "generator", "generator.total"));
  EXPECT_THAT(names({0, 0, 1, 0}), ElementsAre("generator.total", "reconstruction"));
}

TEST(Trainer, WithoutAdversarialLossEveryStepIsTheGenerators) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses.adversarial = 0;
  manifest.crop = {32, 40};  // too small for the discriminator
  Trainer trainer(manifest, "cpu");
  for (int step = 0; step < 3; ++step) {
    const auto losses =
        trainer.step(TrainingPhase::kGenerator, step, testing::edge_batch(manifest, 1));
    EXPECT_TRUE(losses.contains("generator.total"));
    EXPECT_FALSE(losses.contains("discriminator"));
  }
}

TEST(Trainer, FlowIsPhotometricAndWeightedSmoothness) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses.smoothness = 0.25;
  Trainer trainer(manifest, "cpu");
  auto losses = trainer.step(TrainingPhase::kFlow, 0, testing::edge_batch(manifest, 1));
  EXPECT_NEAR(losses["flow"], losses["flow.photometric"] + 0.25 * losses["flow.smoothness"], 1e-6);
}

TEST(Trainer, TakesSamplesWithoutEvents) {
  TrainingManifest manifest = testing::small_training();
  Trainer trainer(manifest, "cpu");
  auto batch = testing::edge_batch(manifest, 1);
  for (TrainingSample& sample : batch) std::fill(sample.volume.begin(), sample.volume.end(), 0.0f);
  for (const auto phase : kPhases) {
    for (const int step : {0, 2}) EXPECT_NO_THROW(trainer.step(phase, step, batch));
  }
}

TEST(Trainer, Bfloat16StaysNearFloat32) {
  TrainingManifest manifest = testing::small_training();
  const auto batch = testing::edge_batch(manifest, 1);
  Trainer exact(manifest, "cpu");
  manifest.precision = TrainingPrecision::kBfloat16;
  Trainer coarse(manifest, "cpu");
  for (const auto phase : kPhases) {
    for (const int step : {1, 2}) {
      const StepLosses expected = exact.step(phase, step, batch);
      StepLosses got = coarse.step(phase, step, batch);
      for (const auto& [name, value] : expected) {
        if (name.ends_with("accuracy")) continue;  // a step function of logits near 0
        EXPECT_NEAR(got.at(name), value, 0.05 * std::abs(value) + 0.05) << name;
      }
    }
  }
}

TEST(Trainer, RefusesSamplesThatDoNotFit) {
  const TrainingManifest manifest = testing::small_training();
  Trainer trainer(manifest, "cpu");
  EXPECT_THROWS(trainer.step(TrainingPhase::kFlow, 0, {}), std::invalid_argument,
                "expected samples, got none");
  const auto other_bins = testing::moving_edges(4, {9, {48, 48}}, 1);
  EXPECT_THROWS(trainer.step(TrainingPhase::kFlow, 0, other_bins), std::invalid_argument,
                "expected samples of one size and 3 bins, all with a");
  auto cut = testing::edge_batch(manifest, 1);
  cut[2].volume.pop_back();
  EXPECT_THROWS(trainer.step(TrainingPhase::kFlow, 0, cut), std::invalid_argument,
                "expected 13824 numbers, got 13823, in edge 1.2");
  auto mixed = testing::edge_batch(manifest, 1);
  mixed[1] = testing::moving_edges(1, {3, {64, 48}}, 1)[0];
  EXPECT_THROWS(trainer.step(TrainingPhase::kFlow, 0, mixed), std::invalid_argument,
                "expected samples of one size and 3 bins, all with a");
}

TEST(Trainer, TheStateHasTheNetworksThatAreUsed) {
  const auto networks = [](const LossWeights& losses, const PhaseSteps& steps) {
    TrainingManifest manifest = testing::small_training();
    manifest.losses = losses;
    manifest.steps = steps;
    std::set<std::string> names;
    for (const auto& [key, tensor] : Trainer(manifest, "cpu").state()) {
      const std::string optimizer = "optimizer.";
      const std::string name = key.starts_with(optimizer) ? key.substr(optimizer.size()) : key;
      names.insert(name.substr(0, name.find('.')));
    }
    return names;
  };
  const LossWeights direct{.adversarial = 0, .flow = 0, .reconstruction = 0, .volume = 1};
  LossWeights flow = direct, paper = direct;
  flow.flow = 1;
  paper.adversarial = paper.flow = paper.reconstruction = 1;
  EXPECT_THAT(networks(direct, {.flow = 0, .reconstruction = 0, .generator = 5}),
              ElementsAre("generator"));
  EXPECT_THAT(networks(direct, {.flow = 0, .reconstruction = 5, .generator = 0}),
              ElementsAre("generator", "reconstruction"));
  EXPECT_THAT(networks(flow, {.flow = 0, .reconstruction = 0, .generator = 5}),
              ElementsAre("flow", "generator"));
  EXPECT_THAT(networks(paper, {.flow = 0, .reconstruction = 0, .generator = 5}),
              ElementsAre("discriminator", "flow", "generator", "reconstruction"));
}

TEST(Trainer, LoadNamesWhatIsMissing) {
  Trainer trainer(testing::small_training(), "cpu");
  StateDict state = trainer.state();
  state.erase("flow.pred_layers.2.conv2d.bias");
  try {
    trainer.load(state);
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("flow.pred_layers.2.conv2d.bias"));
  }
}

struct TrainedCase {
  std::string name;
  SpectralNormPlace spectral_norm = SpectralNormPlace::kNone;
  double difference_gain = 0;
  bool sensor = false;
};

class TrainedGenerator : public ::testing::TestWithParam<TrainedCase> {};

/// The network that the state has, unfolded and in evaluation, on one sample: [2 bins, y, x].
std::vector<float> own_image(const TrainingManifest& manifest, const StateDict& state,
                             const TrainingSample& sample) {
  const at::NoGradGuard only_looking;
  TrainingNetworks networks(manifest, c10::kCPU);
  load_network(*networks.generator, state, "generator.");
  networks.generator->eval();
  const TrainingBatch batch = make_training_batch({&sample, 1}, manifest.network.bins, c10::kCPU);
  const at::Tensor volume = networks.generator->forward(batch.generator_input)[0].contiguous();
  return {volume.data_ptr<float>(), volume.data_ptr<float>() + volume.numel()};
}

TEST_P(TrainedGenerator, FoldedEqualsItsOwnImageAndFoldingChangesNothing) {
  TrainingManifest manifest = testing::small_training();
  manifest.network.spectral_norm = GetParam().spectral_norm;
  manifest.network.difference_gain = GetParam().difference_gain;
  manifest.network.sensor = GetParam().sensor;
  const auto told = [](std::vector<TrainingSample> samples) {
    for (TrainingSample& sample : samples) {
      if (GetParam().sensor) sample.threshold = ContrastThreshold{0.4, 1.5};
    }
    return samples;
  };
  Trainer trainer(manifest, "cpu");
  for (int step = 0; step < 6; ++step) {
    trainer.step(TrainingPhase::kGenerator, step, told(testing::edge_batch(manifest, step)));
  }
  const StateDict before = trainer.state();
  // Another size than the crop's, odd.
  const TrainingSample sample = told(testing::moving_edges(1, {3, {37, 50}}, 9))[0];
  const std::vector<float> volume = own_image(manifest, before, sample);
  const std::optional<ThresholdRange> thresholds =
      GetParam().sensor ? std::optional(ThresholdRange{0.1, 1}) : std::nullopt;
  const auto engine = make_torch_generator(
      fold_generator(trainer.generator_state(), "the trained generator", thresholds));
  EXPECT_THAT(changed_parts(before, trainer.state()), ElementsAre());
  std::vector<float> folded(volume.size());
  engine->generate({sample.network_frames, sample.shape.size, sample.threshold}, folded);
  const float largest = *std::max_element(volume.begin(), volume.end());
  ASSERT_GT(largest, 0);
  for (std::size_t i = 0; i < volume.size(); ++i) {
    ASSERT_NEAR(folded[i], volume[i], 1e-4f * largest) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Networks, TrainedGenerator,
    ::testing::Values(TrainedCase{"decoders", SpectralNormPlace::kDecoders},
                      TrainedCase{"encoders", SpectralNormPlace::kEncoders}, TrainedCase{"none"},
                      TrainedCase{"difference_gain", SpectralNormPlace::kNone, 8},
                      TrainedCase{"sensor", SpectralNormPlace::kNone, 0, true},
                      TrainedCase{"sensor_and_difference_gain", SpectralNormPlace::kDecoders, 8,
                                  true}),
    [](const auto& each) { return each.param.name; });

}  // namespace
}  // namespace eventgan
