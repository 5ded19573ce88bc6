#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "stages/training/trainer.h"
#include "tests/stages/training/small_training.h"

// What training is for: 50 steps lower every loss, and a training that stops and goes on is the
// same training.

namespace eventgan {
namespace {

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
