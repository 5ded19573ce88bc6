#include "pipeline/training/run_training.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>
#include <stdexcept>

#include "manifests/faults.h"
#include "pipeline/errors/error_text.h"
#include "pipeline/training/training_lock.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights_files/weights_file.h"
#include "tests/pipeline/training/small_training.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class SmallTraining : public ::testing::Test {
 protected:
  TrainingReport train(const std::string& output, std::optional<std::int64_t> max_steps = {},
                       const std::string& replace = "", const std::string& with = "") {
    TrainingOptions options;
    options.output = folder_ / output;
    options.threads = 1;
    options.max_steps = max_steps;
    options.overwrite = overwrite_;
    options.warn = [&](const std::string& text) { warnings_.push_back(text); };
    return run_training(testing::small_training(folder_.path(), replace, with), options);
  }

  std::string file(const std::string& name) { return testing::read_file(folder_ / name); }

  /// The columns of training.csv that do not tell the time.
  std::string losses(const std::string& output) {
    std::string text;
    std::istringstream lines(file(output + "/training.csv"));
    for (std::string line; std::getline(lines, line);) {
      const auto step_end = line.find(',', line.find(',') + 1);
      text += line.substr(0, step_end) + line.substr(line.find(',', step_end + 1)) + '\n';
    }
    return text;
  }

  testing::TemporaryFolder folder_;
  std::vector<std::string> warnings_;
  bool overwrite_ = false;
};

TEST_F(SmallTraining, RunsAllPhasesAndLeavesWeightsThatRun) {
  const TrainingReport report = train("out");
  EXPECT_TRUE(report.complete);
  EXPECT_EQ(report.steps_made, 8);
  EXPECT_EQ(report.position, (TrainingPosition{TrainingPhase::kGenerator, 4}));
  EXPECT_EQ(report.losses.count("generator.total"), 1u);
  const Weights weights = read_weights(report.weights);
  EXPECT_EQ(weights.base_channels, 2);
  EXPECT_EQ(make_torch_generator(weights)->bins(), 3);
  EXPECT_THAT(weights.metadata.at("training_losses"), HasSubstr("generator.total\t"));
  for (const char* made : {"curves.png", "validation.csv", "weights-latest.safetensors",
                           "checkpoints/latest.safetensors", "checkpoints/previous.safetensors"}) {
    EXPECT_TRUE(fs::exists(folder_ / "out" / made)) << made;
  }
  EXPECT_THAT(warnings_, SizeIs(0));
}

TEST_F(SmallTraining, StoppedAnywhereItEndsWithTheSameWeights) {
  train("whole");
  for (const int steps : {1, 2, 5, 7}) {  // within each phase, and between two
    const std::string output = "stopped" + std::to_string(steps);
    const TrainingReport first = train(output, steps);
    EXPECT_FALSE(first.complete);
    EXPECT_EQ(first.steps_made, steps);
    const TrainingReport second = train(output);
    EXPECT_TRUE(second.complete);
    EXPECT_EQ(second.steps_made, 8 - steps);
    EXPECT_EQ(file(output + "/weights.safetensors"), file("whole/weights.safetensors")) << steps;
    EXPECT_EQ(losses(output), losses("whole")) << steps;
    EXPECT_EQ(
        file(output + "/validation.csv").substr(file(output + "/validation.csv").rfind("\n4,")),
        file("whole/validation.csv").substr(file("whole/validation.csv").rfind("\n4,")));
  }
}

TEST_F(SmallTraining, ACompleteOneIsLeftAsItIs) {
  train("out");
  const std::string weights = file("out/weights.safetensors"),
                    checkpoint = file("out/checkpoints/latest.safetensors");
  const TrainingReport again = train("out");
  EXPECT_TRUE(again.complete);
  EXPECT_EQ(again.steps_made, 0);
  EXPECT_EQ(file("out/weights.safetensors"), weights);
  EXPECT_EQ(file("out/checkpoints/latest.safetensors"), checkpoint);
}

TEST_F(SmallTraining, MayBeMadeLonger) {
  train("out");
  const TrainingReport longer = train("out", {}, "\"generator\": 4", "\"generator\": 6");
  EXPECT_EQ(longer.steps_made, 2);
  EXPECT_EQ(longer.position.step, 6);
}

TEST_F(SmallTraining, StopsWhenAskedTo) {
  TrainingOptions options;
  options.output = folder_ / "out";
  options.threads = 1;
  int asked = 0;
  options.stop = [&] { return ++asked > 3; };
  const TrainingReport report = run_training(testing::small_training(folder_.path()), options);
  EXPECT_FALSE(report.complete);
  EXPECT_EQ(report.position, (TrainingPosition{TrainingPhase::kReconstruction, 1}));
  EXPECT_TRUE(report.weights.empty());
}

TEST_F(SmallTraining, CutsOffRowsAfterTheCheckpoint) {
  train("out", 3);
  const std::string before = file("out/training.csv");
  // As a run leaves it that was killed one step and a half after its checkpoint.
  testing::write_file(folder_ / "out" / "training.csv",
                      before + before.substr(before.rfind("rec")) + "reconstruction,2");
  const TrainingReport report = train("out", 0);
  EXPECT_EQ(report.steps_made, 0);
  train("out", 1);
  EXPECT_EQ(file("out/training.csv").substr(0, before.size()), before);
}

TEST_F(SmallTraining, RefusesOtherSettings) {
  train("out", 1);
  try {
    train("out", 1, "\"seed\": 3", "\"seed\": 4");
    FAIL() << "expected UsageError";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(),
                AllOf(HasSubstr("$.seed: expected 3, got 4"), HasSubstr("--overwrite")));
  }
  overwrite_ = true;
  EXPECT_EQ(train("out", 1, "\"seed\": 3", "\"seed\": 4").position.step, 1);
}

TEST_F(SmallTraining, ADamagedCheckpointFallsBackToTheOneBefore) {
  train("whole");
  train("out", 2);
  train("out", 1);
  testing::write_file(folder_ / "out/checkpoints/latest.safetensors", "damaged");
  const TrainingReport report = train("out");
  ASSERT_THAT(warnings_, SizeIs(1));
  EXPECT_THAT(warnings_[0], HasSubstr("latest.safetensors"));
  EXPECT_EQ(report.steps_made, 6);
  EXPECT_EQ(file("out/weights.safetensors"), file("whole/weights.safetensors"));
}

TEST_F(SmallTraining, SaysWhereALossIsNotFinite) {
  TrainingManifest manifest = testing::small_training(folder_.path());
  TrainingOptions options;
  options.output = folder_ / "out";
  options.threads = 1;
  manifest.optimizer.cycle_rate = 1e30;  // the second step's convolutions overflow
  options.max_steps = 1;
  run_training(manifest, options);
  options.max_steps.reset();
  try {
    run_training(manifest, options);
    FAIL() << "expected the training to break down";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(
        error_text(error),
        AllOf(HasSubstr("broke down in phase flow, step 1; last good checkpoint: "),
              HasSubstr("out/checkpoints/latest.safetensors"), HasSubstr("bar.hdf5 frames ")));
  }
}

TEST_F(SmallTraining, NamesTheRecordingThatIsAbsent) {
  EXPECT_THROW(train("out", {}, "\"path\": \"bar.hdf5\"", "\"path\": \"absent.hdf5\""), InputError);
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(SmallTraining, LeavesAFolderAloneThatAnotherRunWritesTo) {
  train("out", 1);
  const std::string losses = file("out/training.csv");
  const TrainingLock other(folder_ / "out");
  overwrite_ = true;
  EXPECT_THROW(train("out"), std::runtime_error);
  EXPECT_EQ(file("out/training.csv"), losses);
  EXPECT_TRUE(fs::exists(folder_ / "out/checkpoints/latest.safetensors"));
}

TEST_F(SmallTraining, DrawsPictures) {
  train("out", {}, "\"picture_minutes\": 1000", "\"picture_minutes\": 0");
  EXPECT_TRUE(fs::exists(folder_ / "out/pictures/generator-1.png"));
  EXPECT_TRUE(fs::exists(folder_ / "out/pictures/generator-4.png"));
}

TEST(TrainingReport, IsTextAndJson) {
  TrainingReport report;
  report.folder = "out";
  report.position = {TrainingPhase::kReconstruction, 12};
  report.losses["reconstruction"] = 0.5;
  EXPECT_THAT(to_text(report),
              AllOf(HasSubstr("stopped, run again"), HasSubstr("reconstruction 12"),
                    HasSubstr("reconstruction 0.5")));
  EXPECT_THAT(to_json(report),
              AllOf(HasSubstr("\"complete\":false"), HasSubstr("\"next_step\":12")));
}

}  // namespace
}  // namespace eventgan
