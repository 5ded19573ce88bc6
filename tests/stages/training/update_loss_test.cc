#include <ATen/Functions.h>
#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>
#include <gtest/gtest.h>

#include "stages/training/update_loss_internal.h"
#include "tests/stages/training/small_training.h"

namespace eventgan {
namespace {

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
      .adversarial = 2, .flow = 3, .reconstruction = 4, .volume = 5, .count = 6};
  UpdateLoss loss = generator_update(networks, batch, weights);
  const auto part = [&](const char* name) { return loss.parts.at(name).item<double>(); };
  EXPECT_NEAR(loss.total.item<double>(),
              2 * part("generator") + 3 * part("flow") + 4 * part("reconstruction") +
                  5 * part("volume") + 6 * part("count"),
              1e-4);
  for (auto term : {&LossWeights::adversarial, &LossWeights::flow, &LossWeights::reconstruction,
                    &LossWeights::volume, &LossWeights::count}) {
    LossWeights single{0, 0, 0, 0, 0};
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

}  // namespace
}  // namespace eventgan
