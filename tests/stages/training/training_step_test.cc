#include <ATen/Functions.h>
#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/from_blob.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <stdexcept>

#include "stages/training/detail/training_batch.h"
#include "stages/training/detail/update_loss.h"
#include "stages/training/losses.h"
#include "stages/training/trainer.h"
#include "tests/stages/training/small_training.h"
#include "tests/testing/texts.h"

// What training is for: 50 steps lower every loss, and a training that stops and goes on is the
// same training.

namespace eventgan {
namespace {

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

TEST(TrainingBatch, ShowsTheGeneratorTheNetworkFramesOrTheSensorsInputOfThem) {
  std::vector<TrainingSample> samples = testing::moving_edges(2, {1, {5, 7}}, 1);
  for (TrainingSample& sample : samples) {
    for (float& value : sample.network_frames) value *= 0.5f;  // as if by a gain
  }
  const TrainingBatch plain = make_training_batch(samples, 1, c10::kCPU);
  EXPECT_TRUE(plain.generator_input.equal(plain.network_frames));
  const auto alone = [&](std::size_t i) {
    return make_training_batch({&samples[i], 1}, 1, c10::kCPU).generator_input[0];
  };
  EXPECT_TRUE(alone(1).equal(plain.network_frames[1]));

  samples[0].threshold = ContrastThreshold{0.2};
  samples[1].threshold = ContrastThreshold{0.3, 2};
  const TrainingBatch told = make_training_batch(samples, 1, c10::kCPU);
  ASSERT_EQ(told.generator_input.sizes(), (at::IntArrayRef{2, 3, 5, 7}));
  EXPECT_TRUE(told.network_frames.equal(plain.network_frames));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    std::vector<float> planes = sensor_input(samples[i].network_frames, *samples[i].threshold);
    const at::Tensor expected = at::from_blob(planes.data(), {3, 5, 7});
    EXPECT_TRUE(told.generator_input[std::int64_t(i)].equal(expected)) << i;
    EXPECT_TRUE(alone(i).equal(expected)) << i;
  }
}

TEST(TrainingBatch, RefusesWhatDoesNotFitAndThresholdsOfSomeSamples) {
  for (const std::size_t told : {0, 1}) {
    std::vector<TrainingSample> samples{sample_from(0), sample_from(0)};
    samples[told].threshold = ContrastThreshold{0.2};
    EXPECT_THROWS(make_training_batch(samples, 1, c10::kCPU), std::invalid_argument,
                  "all with a threshold or none");
  }
  EXPECT_THROWS(make_training_batch({}, 1, c10::kCPU), std::invalid_argument,
                "expected samples, got none");
  std::vector<TrainingSample> samples{sample_from(0), sample_from(1)};
  EXPECT_THROWS(make_training_batch(samples, 2, c10::kCPU), std::invalid_argument,
                "expected samples of one size and 2 bins, all with a");
  samples[1].volume.pop_back();
  EXPECT_THROWS(make_training_batch(samples, 1, c10::kCPU), std::invalid_argument,
                "expected 4 numbers, got 3, in desk");
}

TEST(TrainingBatch, ExpectsWhatATeacherSaysOrWhatHappened) {
  std::vector<TrainingSample> samples{sample_from(0), sample_from(100)};
  const TrainingBatch alone = make_training_batch(samples, 1, c10::kCPU);
  EXPECT_TRUE(alone.expected.equal(alone.volume));
  samples[0].taught_rates = {1, 2, 3, 4};
  EXPECT_THROWS(make_training_batch(samples, 1, c10::kCPU), std::invalid_argument,
                "a teacher's rates or none");
  samples[1].taught_rates = {5, 6, 7, 8};
  const TrainingBatch taught = make_training_batch(samples, 1, c10::kCPU);
  EXPECT_TRUE(taught.volume.equal(alone.volume));
  EXPECT_EQ(taught.expected[1][0][0][1].item<float>(), 6);
}

/// Without spectral norm a network in training mode gives the same whatever ran before.
TrainingManifest stateless_training() {
  TrainingManifest manifest = testing::small_training();
  manifest.network.spectral_norm = SpectralNormPlace::kNone;
  return manifest;
}

TrainingBatch batch_of(const TrainingManifest& manifest) {
  auto samples = testing::edge_batch(manifest, 1);
  for (TrainingSample& sample : samples) {
    for (float& value : sample.network_frames) value *= 0.5f;  // as if by a gain
  }
  return make_training_batch(samples, manifest.network.bins, c10::kCPU);
}

/// Mean hinge of logits taken for real and for fake.
double hinge(const at::Tensor& real, const at::Tensor& fake) {
  return ((1 - real).clamp_min(0).mean() + (1 + fake).clamp_min(0).mean()).item<double>();
}

TEST(DiscriminatorUpdate, JudgesFakesOfTheFirstHalfAndTheSecondHalfsVolumes) {
  TrainingManifest manifest = stateless_training();
  const TrainingBatch batch = batch_of(manifest);
  TrainingNetworks networks(manifest, c10::kCPU);
  const at::NoGradGuard numbers_only;
  const at::Tensor fakes = networks.generator->forward(batch.network_frames.narrow(0, 0, 2))[0];
  const at::Tensor fake = networks.discriminator->forward(fakes, batch.frames.narrow(0, 0, 2));
  const at::Tensor real =
      networks.discriminator->forward(batch.volume.narrow(0, 2, 2), batch.frames.narrow(0, 2, 2));
  const auto total = [&](double label_flip) {
    manifest.label_flip = label_flip;
    return discriminator_update(networks, batch, manifest, 0).total.item<double>();
  };
  EXPECT_NEAR(total(0), hinge(real, fake), 1e-5);
  EXPECT_NEAR(total(1), hinge(fake, real), 1e-5);
}

TEST(DiscriminatorUpdate, LeavesTheGeneratorWithoutGradient) {
  const TrainingManifest manifest = stateless_training();
  TrainingNetworks networks(manifest, c10::kCPU);
  discriminator_update(networks, batch_of(manifest), manifest, 0).total.backward();
  for (const at::Tensor& parameter : networks.generator->parameters()) {
    EXPECT_FALSE(parameter.grad().defined());
  }
  for (const at::Tensor& parameter : networks.discriminator->parameters()) {
    EXPECT_TRUE(parameter.grad().defined());
  }
}

TEST(GeneratorUpdate, IsTheWeightedSumAndReachesTheGeneratorThroughTheFrozenNetworks) {
  const TrainingManifest manifest = stateless_training();
  const TrainingBatch batch = batch_of(manifest);
  TrainingNetworks networks(manifest, c10::kCPU);
  const LossWeights weights{
      .adversarial = 2, .flow = 3, .reconstruction = 4, .volume = 5, .count = 6, .overlap = 7};
  UpdateLoss loss = generator_update(networks, batch, weights);
  const auto part = [&](const char* name) { return loss.parts.at(name).item<double>(); };
  EXPECT_NEAR(loss.total.item<double>(),
              2 * part("generator") + 3 * part("flow") + 4 * part("reconstruction") +
                  5 * part("volume") + 6 * part("count") + 7 * part("overlap"),
              1e-4);
  for (auto term : {&LossWeights::adversarial, &LossWeights::flow, &LossWeights::reconstruction,
                    &LossWeights::volume, &LossWeights::count, &LossWeights::overlap}) {
    LossWeights single{0, 0, 0, 0, 0, 0};
    single.*term = 1;
    for (at::Tensor& parameter : networks.generator->parameters()) {
      parameter.mutable_grad() = at::Tensor();
    }
    generator_update(networks, batch, single).total.backward();
    const at::Tensor gradient = networks.generator->parameters()[0].grad();
    ASSERT_TRUE(gradient.defined());
    EXPECT_GT(gradient.abs().max().item<double>(), 0);
  }
}

TEST(GeneratorUpdate, LearnsTheRatesOfATeacherAndTheEventsThatHappened) {
  TrainingManifest manifest = stateless_training();
  TrainingNetworks networks(manifest, c10::kCPU);
  const LossWeights weights{.adversarial = 0,
                            .flow = 0,
                            .reconstruction = 0,
                            .volume = 1,
                            .count = 1,
                            .overlap = 1,
                            .likelihood = 1,
                            .block_likelihood = 1};
  TrainingBatch batch = batch_of(manifest);
  const auto alone = generator_update(networks, batch, weights).parts;
  batch.expected = batch.volume + 0.25;
  const auto taught = generator_update(networks, batch, weights).parts;
  for (const char* events : {"volume", "count", "overlap"}) {
    EXPECT_EQ(taught.at(events).item<float>(), alone.at(events).item<float>()) << events;
  }
  const at::Tensor volume = networks.run(networks.generator, batch.generator_input)[0];
  EXPECT_FLOAT_EQ(taught.at("likelihood").item<float>(),
                  likelihood_loss(volume, batch.expected).item<float>());
  EXPECT_FLOAT_EQ(taught.at("block_likelihood").item<float>(),
                  block_likelihood_loss(volume, batch.expected).item<float>());
  EXPECT_NE(taught.at("likelihood").item<float>(), alone.at("likelihood").item<float>());
}

TEST(TrainingBatch, KnowsWhereThereAreEvents) {
  TrainingSample sample;
  sample.shape = {1, {1, 3}};
  sample.frames = {1, 2, 3, 4, 5, 6};
  sample.network_frames = sample.frames;
  sample.volume = {0, 0.5f, 0, 0, 0, 1};
  const TrainingBatch batch = make_training_batch({&sample, 1}, 1, c10::kCPU);
  EXPECT_TRUE(batch.has_events().equal(at::tensor({0.f, 1.f, 1.f}).view({1, 1, 1, 3}).gt(0)));
  EXPECT_TRUE(batch.previous().equal(at::tensor({1.f, 2.f, 3.f}).view({1, 1, 1, 3})));
  EXPECT_TRUE(batch.next().equal(at::tensor({4.f, 5.f, 6.f}).view({1, 1, 1, 3})));
}

constexpr int kSteps = 50;

/// Each loss over a phase's steps, on three batches in turn.
std::map<std::string, std::vector<double>> curves(Trainer& trainer,
                                                  const TrainingManifest& manifest,
                                                  TrainingPhase phase, int first = 0,
                                                  int end = kSteps) {
  std::map<std::string, std::vector<double>> result;
  for (int step = first; step < end; ++step) {
    const auto batch = testing::edge_batch(manifest, step % 3);
    for (const auto& [name, value] : trainer.step(phase, step, batch)) {
      result[name].push_back(value);
    }
  }
  return result;
}

double mean(std::vector<double>::const_iterator begin, std::vector<double>::const_iterator end) {
  return std::accumulate(begin, end, 0.0) / double(end - begin);
}

/// Mean of the last tenth of a curve less that of the first.
double change(const std::vector<double>& curve) {
  const auto part = std::ptrdiff_t(std::max<std::size_t>(curve.size() / 10, 3));
  return mean(curve.end() - part, curve.end()) - mean(curve.begin(), curve.begin() + part);
}

TEST(TrainerLearning, LowersTheFlowLoss) {
  const TrainingManifest manifest = testing::small_training();
  Trainer trainer(manifest, "cpu");
  const auto losses = curves(trainer, manifest, TrainingPhase::kFlow);
  EXPECT_LT(change(losses.at("flow")), -0.05);
  EXPECT_LT(change(losses.at("flow.photometric")), 0);
}

TEST(TrainerLearning, LowersTheReconstructionLoss) {
  const TrainingManifest manifest = testing::small_training();
  Trainer trainer(manifest, "cpu");
  const auto losses = curves(trainer, manifest, TrainingPhase::kReconstruction);
  EXPECT_LT(change(losses.at("reconstruction")), -0.2);
}

TEST(TrainerLearning, LowersTheVolumeLoss) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses = {.adversarial = 0, .flow = 0, .reconstruction = 0, .volume = 1};
  Trainer trainer(manifest, "cpu");
  const auto losses = curves(trainer, manifest, TrainingPhase::kGenerator);
  const std::vector<double>& loss = losses.at("volume");
  EXPECT_LT(change(loss), -0.2 * loss.front());
}

TEST(TrainerLearning, LowersTheLikelihoodLossOfANetworkThatKnowsItsSensor) {
  TrainingManifest manifest = testing::small_training();
  manifest.network.sensor = true;
  manifest.network.difference_gain = 4;
  manifest.network.output_slope = 0.25;
  manifest.losses = {.adversarial = 0, .flow = 0, .reconstruction = 0, .likelihood = 1};
  Trainer trainer(manifest, "cpu");
  std::vector<double> curve;
  double events = 0, voxels = 0, least = 0;
  for (int step = 0; step < kSteps; ++step) {
    auto batch = testing::edge_batch(manifest, step % 3);
    for (TrainingSample& sample : batch) {
      sample.threshold = ContrastThreshold{0.5, 1.5};
      events += std::accumulate(sample.volume.begin(), sample.volume.end(), 0.0);
      voxels += double(sample.volume.size());
      for (const float real : sample.volume) least += (real + 1) * (1 - std::log(real + 1));
    }
    const StepLosses losses = trainer.step(TrainingPhase::kGenerator, step, batch);
    EXPECT_EQ(losses.at("likelihood"), losses.at("generator.total"));
    curve.push_back(losses.at("likelihood"));
  }
  // Of all networks that look at nothing the best expects the same everywhere: the mean.
  const double everywhere = events / voxels + 1;
  const double of_the_mean = everywhere * (1 - std::log(everywhere)) - least / voxels;
  EXPECT_LT(mean(curve.end() - 6, curve.end()), 0.95 * of_the_mean);
  EXPECT_LT(change(curve), 0);
}

TEST(TrainerLearning, LeavesDirectLossesBehindIfItKnowsItsSensor) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses = {.adversarial = 0,
                     .flow = 0,
                     .reconstruction = 0,
                     .volume = 1,
                     .count = 0.5,
                     .overlap = 0.25,
                     .likelihood = 2,
                     .block_likelihood = 0.75};
  manifest.network.sensor = true;
  manifest.steps.generator = 8;
  auto batch = testing::edge_batch(manifest, 0);
  for (TrainingSample& sample : batch) sample.threshold = ContrastThreshold{0.5};
  Trainer trainer(manifest, "cpu");
  for (int step = 0; step < 8; ++step) {
    const StepLosses losses = trainer.step(TrainingPhase::kGenerator, step, batch);
    double total = 2 * losses.at("likelihood") + 0.75 * losses.at("block_likelihood");
    const double direct =
        losses.at("volume") + 0.5 * losses.at("count") + 0.25 * losses.at("overlap");
    total += (1 - step / 8.0) * direct;
    EXPECT_NEAR(losses.at("generator.total"), total, 1e-5 * total) << step;
  }
}

TEST(TrainerLearning, LowersTheCycleLossesOfTheGenerator) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses.adversarial = 0;
  manifest.losses.volume = 0;
  manifest.optimizer.generator_rate = 2e-2;
  Trainer trainer(manifest, "cpu");
  curves(trainer, manifest, TrainingPhase::kFlow, 0, 20);
  curves(trainer, manifest, TrainingPhase::kReconstruction, 0, 20);
  const auto losses = curves(trainer, manifest, TrainingPhase::kGenerator);
  // Little: the frozen networks have hardly learned to look at the volume yet.
  EXPECT_LT(change(losses.at("flow")), -0.005);
  EXPECT_LT(change(losses.at("reconstruction")), 0);
}

TEST(TrainerLearning, LowersTheDiscriminatorsLoss) {
  TrainingManifest manifest = testing::small_training();
  manifest.label_flip = 0;
  Trainer trainer(manifest, "cpu");
  const auto losses = curves(trainer, manifest, TrainingPhase::kGenerator);
  EXPECT_EQ(losses.at("discriminator").size(), 34u);  // steps 0, 1, 3, 4, ..., 48, 49
  EXPECT_EQ(losses.at("generator").size(), 16u);
  EXPECT_LT(change(losses.at("discriminator")), -0.1);
}

TEST(TrainerLearning, GoesOnFromItsStateAsIfItHadNotStopped) {
  TrainingManifest manifest = testing::small_training();
  manifest.optimizer.final_rate_fraction = 0.1;
  Trainer whole(manifest, "cpu");
  curves(whole, manifest, TrainingPhase::kFlow, 0, 8);
  curves(whole, manifest, TrainingPhase::kReconstruction, 0, 8);
  curves(whole, manifest, TrainingPhase::kGenerator, 0, 25);
  const StateDict half_way = whole.state();
  Trainer second(manifest, "cpu");
  second.load(half_way);
  for (Trainer* trainer : {&whole, &second}) {
    curves(*trainer, manifest, TrainingPhase::kGenerator, 25, kSteps);
    curves(*trainer, manifest, TrainingPhase::kFlow, 8, 11);
    curves(*trainer, manifest, TrainingPhase::kReconstruction, 8, 11);
  }
  const StateDict expected = whole.state(), got = second.state();
  ASSERT_EQ(got.size(), expected.size());
  for (const auto& [key, tensor] : expected) EXPECT_EQ(got.at(key).values, tensor.values) << key;
}

}  // namespace
}  // namespace eventgan
