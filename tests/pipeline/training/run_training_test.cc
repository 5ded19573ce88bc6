#include "pipeline/training/run_training.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <optional>
#include <sstream>
#include <stdexcept>

#include "manifests/values/faults.h"
#include "pipeline/runtime/errors.h"
#include "pipeline/training/training_folder.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights_file.h"
#include "tests/pipeline/training/bar_training.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::ThrowsMessage;

TEST(TrainingFolder, DiscardsItsOwnFilesOnly) {
  const testing::TemporaryFolder root;
  const TrainingFolder folder{root.path()};
  folder.prepare();
  const std::vector<std::filesystem::path> own{folder.checkpoints() / "latest.safetensors",
                                               folder.checkpoints() / "previous.safetensors",
                                               folder.losses(),
                                               folder.curves(),
                                               folder.validation(),
                                               folder.weights(),
                                               folder.latest_weights(),
                                               folder.image({TrainingPhase::kGenerator, 12})};
  for (const auto& file : own) testing::write_file(file, "x");
  testing::write_file(root / "notes.txt", "mine");
  testing::write_file(folder.images() / "mine.png", "mine");
  folder.discard();
  for (const auto& file : own) EXPECT_FALSE(std::filesystem::exists(file)) << file;
  EXPECT_TRUE(std::filesystem::exists(root / "notes.txt"));
  EXPECT_TRUE(std::filesystem::exists(folder.images() / "mine.png"));
}

TEST(TrainingFolder, ReachesNothingThroughALink) {
  for (const char* name : {"checkpoints", "images"}) {
    const testing::TemporaryFolder root;
    const testing::TemporaryFolder elsewhere;
    const TrainingFolder folder{root.path()};
    const std::vector<std::string> files{"generator-12.png", "latest.safetensors"};
    for (const std::string& file : files) testing::write_file(elsewhere / file, "mine");
    testing::write_file(folder.weights(), "x");
    std::filesystem::create_directory_symlink(elsewhere.path(), root / name);
    const auto names_it = ThrowsMessage<std::runtime_error>(
        HasSubstr("got a symbolic link, in " + (root / name).string()));
    EXPECT_THAT([&] { folder.discard(); }, names_it);
    EXPECT_THAT([&] { folder.prepare(); }, names_it);
    for (const std::string& file : files) EXPECT_TRUE(std::filesystem::exists(elsewhere / file));
    EXPECT_TRUE(std::filesystem::exists(folder.weights()));
  }
}

TEST(TrainingFolder, DiscardsImagesOfItsOwnNamesAlone) {
  const testing::TemporaryFolder root;
  const TrainingFolder folder{root.path()};
  folder.prepare();
  for (const char* mine : {"generator-best.png", "generator-.png", "generator-12.png.png"}) {
    testing::write_file(folder.images() / mine, "mine");
    folder.discard();
    EXPECT_TRUE(std::filesystem::exists(folder.images() / mine)) << mine;
  }
  EXPECT_NO_THROW(TrainingFolder{"/nowhere"}.discard());
}

TEST(TrainingLock, HoldsOthersOffAndSaysWhoItIs) {
  const testing::TemporaryFolder root;
  std::optional<TrainingLock> first(root / "out");
  EXPECT_THROWS(TrainingLock second(root / "out"), std::runtime_error,
                "process " + std::to_string(::getpid()), (root / "out").string());
  const TrainingLock elsewhere(root / "other");
  first.reset();
  EXPECT_NO_THROW(TrainingLock(root / "out"));
}

TEST(TrainingLock, IsNotWrittenThroughALinkAndNamesTheFileThatCannotBeMade) {
  const testing::TemporaryFolder root;
  testing::write_file(root / "mine.txt", "mine");
  std::filesystem::create_directory(root / "out");
  std::filesystem::create_symlink(root / "mine.txt", root / "out/training.lock");
  EXPECT_THROWS(TrainingLock(root / "out"), std::runtime_error, "training.lock");
  EXPECT_EQ(testing::read_file(root / "mine.txt"), "mine");
  EXPECT_THROWS(TrainingLock("/proc/none"), std::runtime_error, "cannot create directories");
}

class ShownTraining : public ::testing::Test {
 protected:
  /// Three steps of a second each, the discriminator's loss in the second only.
  std::string shown(ProgressStyle style) {
    std::ostringstream stream;
    {
      TrainingProgress progress(stream, style, {}, [&] { return now_; });
      for (int done = 1; done <= 3; ++done) {
        now_ += std::chrono::seconds(10);
        progress.advance(TrainingPhase::kGenerator, done, 100,
                         done == 2 ? std::map<std::string, double>{{"discriminator", 1.5}}
                                   : std::map<std::string, double>{{"generator.total", 0.25}});
      }
    }
    return stream.str();
  }

  std::chrono::steady_clock::time_point now_{};
};

TEST_F(ShownTraining, IsLinesABarOrJson) {
  EXPECT_THAT(shown(ProgressStyle::kLines),
              HasSubstr("generator 3/100, 0h16m10s left, 0.10 steps/s, generator.total 0.25, "
                        "discriminator 1.5\n"));
  const std::string text = shown(ProgressStyle::kBar);
  EXPECT_THAT(text, HasSubstr("] generator 3/100"));
  EXPECT_EQ(text.back(), '\n');
  EXPECT_THAT(shown(ProgressStyle::kJson), HasSubstr("\"phase\":\"generator\""));
  EXPECT_THAT(shown(ProgressStyle::kNone), Not(HasSubstr("generator")));
  EXPECT_THAT(shown(ProgressStyle::kAuto), HasSubstr("generator 1/100"));  // no terminal: lines
}

constexpr char kWithout[] = "x86-64 avx2 fma avx512f avx512vnni";
constexpr char kWith[] = "x86-64 avx2 fma avx512f avx512vnni avx512bf16";

TEST(PrecisionAdvice, WarnsOfBfloat16WithoutInstructionsForItAlone) {
  EXPECT_THAT(precision_advice(TrainingPrecision::kBfloat16, "cpu", kWithout), HasSubstr(kWithout));
  EXPECT_EQ(precision_advice(TrainingPrecision::kBfloat16, "cpu", kWith), "");
  EXPECT_EQ(precision_advice(TrainingPrecision::kBfloat16, "cuda", kWithout), "");
  EXPECT_EQ(precision_advice(TrainingPrecision::kFloat32, "cpu", kWithout), "");
}

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
  for (const char* made : {"curves.svg", "validation.csv", "weights-latest.safetensors",
                           "checkpoints/latest.safetensors", "checkpoints/previous.safetensors"}) {
    EXPECT_TRUE(fs::exists(folder_ / "out" / made)) << made;
  }
  EXPECT_THAT(warnings_, SizeIs(0));
}

TEST_F(SmallTraining, StoppedAnywhereItEndsWithTheSameWeights) {
  train("whole");
  for (const int steps : {0, 1, 2, 5, 7}) {  // before the first, within each phase, between two
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

TEST_F(SmallTraining, NeverOverwritesAnotherTraining) {
  train("out", 1);
  const std::string checkpoint = file("out/checkpoints/latest.safetensors");
  fs::copy(folder_ / "bar.hdf5", folder_ / "second.hdf5");
  const struct {
    std::string was, is;
  } others[] = {{"\"name\": \"", "\"name\": \"other-"},
                {"\"path\": \"bar.hdf5\"", "\"path\": \"second.hdf5\""}};
  for (const auto& other : others) {
    for (const bool overwrite : {false, true}) {
      overwrite_ = overwrite;
      const auto train_other = [&] { train("out", 1, other.was, other.is); };
      EXPECT_THAT(train_other,
                  ::testing::ThrowsMessage<UsageError>(
                      AllOf(HasSubstr("got that of another"), Not(HasSubstr("--overwrite")))))
          << other.is;
      EXPECT_EQ(file("out/checkpoints/latest.safetensors"), checkpoint) << other.is;
    }
  }
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
        AllOf(HasSubstr("diverged in phase flow, step 1; last good checkpoint: "),
              HasSubstr("out/checkpoints/latest.safetensors"), HasSubstr("bar.hdf5 frames ")));
  }
}

TEST_F(SmallTraining, NamesTheRecordingThatIsAbsent) {
  EXPECT_THROWS(train("out", {}, "\"path\": \"bar.hdf5\"", "\"path\": \"absent.hdf5\""), InputError,
                "expected an HDF5 file, got none");
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(SmallTraining, LeavesAFolderAloneThatAnotherRunWritesTo) {
  train("out", 1);
  const std::string losses = file("out/training.csv");
  const TrainingLock other(folder_ / "out");
  overwrite_ = true;
  EXPECT_THROWS(train("out"), std::runtime_error,
                "expected an output folder that no other training writes to");
  EXPECT_EQ(file("out/training.csv"), losses);
  EXPECT_TRUE(fs::exists(folder_ / "out/checkpoints/latest.safetensors"));
}

TEST_F(SmallTraining, DrawsImages) {
  train("out", {}, "\"image_minutes\": 1000", "\"image_minutes\": 0");
  EXPECT_TRUE(fs::exists(folder_ / "out/images/generator-1.png"));
  EXPECT_TRUE(fs::exists(folder_ / "out/images/generator-4.png"));
}

TEST_F(SmallTraining, DrawsAnImageAfterItsLastStepHoweverFewThereAre) {
  train("out");  // in far less than the 1000 minutes between two
  EXPECT_TRUE(fs::exists(folder_ / "out/images/generator-4.png"));
  EXPECT_FALSE(fs::exists(folder_ / "out/images/generator-1.png"));
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
