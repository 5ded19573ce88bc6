#include "pipeline/training/records/loss_log.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

constexpr auto kFlow = TrainingPhase::kFlow;
constexpr auto kGenerator = TrainingPhase::kGenerator;

TEST(LossLog, WritesARowAStep) {
  const testing::TemporaryFolder folder;
  LossLog log(folder / "training.csv", {});
  log.add({kFlow, 0}, 1.5, {{"flow", 0.25}, {"flow.smoothness", 2}, {"unknown", 7}}, 1e-3);
  log.flush();
  EXPECT_EQ(testing::read_file(folder / "training.csv"),
            "phase,step,seconds,flow,flow.photometric,flow.smoothness,reconstruction,volume,count,"
            "generator,generator.total,discriminator,discriminator.real_accuracy,"
            "discriminator.fake_accuracy,learning_rate\n"
            "flow,0,1.5,0.25,,2,,,,,,,,,0.001\n");
  ASSERT_EQ(log.rows().size(), 1u);
  EXPECT_EQ(log.rows()[0].losses[0], 0.25);
  EXPECT_TRUE(std::isnan(log.rows()[0].losses[1]));
}

TEST(LossLog, GoesOnAfterTheCheckpointsStep) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "training.csv";
  {
    LossLog log(file, {});
    for (int step = 0; step < 3; ++step) log.add({kFlow, step}, step, {{"flow", step}}, 1);
    for (int step = 0; step < 3; ++step) log.add({kGenerator, step}, step, {{"volume", step}}, 1);
  }
  LossLog log(file, {kGenerator, 1});
  ASSERT_EQ(log.rows().size(), 4u);
  EXPECT_EQ(log.rows().back().position, (TrainingPosition{kGenerator, 0}));
  log.add({kGenerator, 1}, 9, {{"volume", 5}}, 1);
  log.flush();
  const std::string text = testing::read_file(file);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 6);
  EXPECT_EQ(text.find("generator,2,"), std::string::npos);
}

TEST(LossLog, WithoutACheckpointEverythingGoes) {
  const testing::TemporaryFolder folder;
  { LossLog(folder / "training.csv", {}).add({kFlow, 0}, 0, {{"flow", 1}}, 1); }
  EXPECT_TRUE(LossLog(folder / "training.csv", {}).rows().empty());
}

TEST(MeanLosses, AreOverTheLastStepsOfThePhaseThatHaveThem) {
  const testing::TemporaryFolder folder;
  LossLog log(folder / "training.csv", {});
  log.add({kFlow, 0}, 0, {{"flow", 100}}, 1);
  log.add({kGenerator, 0}, 0, {{"volume", 50}}, 1);
  log.add({kGenerator, 1}, 0, {{"discriminator", 2}}, 1);
  log.add({kGenerator, 2}, 0, {{"volume", 1}}, 1);
  log.add({kGenerator, 3}, 0, {{"volume", 3}}, 1);
  EXPECT_EQ(mean_losses(log.rows(), kGenerator, 3),
            (std::map<std::string, double>{{"discriminator", 2}, {"volume", 2}}));
  EXPECT_EQ(mean_losses(log.rows(), kGenerator, 100).at("volume"), 18);
  EXPECT_TRUE(mean_losses({}, kGenerator, 3).empty());
}

}  // namespace
}  // namespace eventgan
