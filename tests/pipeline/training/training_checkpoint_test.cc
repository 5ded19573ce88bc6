#include "pipeline/training/training_checkpoint.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "tests/pipeline/training/bar_training.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::SizeIs;

class Resumption : public ::testing::Test {
 protected:
  std::map<std::string, std::string> settings(const std::string& replace = "",
                                              const std::string& with = "") {
    manifest_ = testing::small_training(folder_.path(), replace, with);
    const auto recordings =
        open_training_recordings(manifest_.recordings, manifest_.directory, manifest_.crop, 1);
    return training_settings(manifest_, recordings);
  }

  /// The message of the refusal; empty if there is none.
  std::string refusal(const TrainingPosition& position, const std::string& replace,
                      const std::string& with) {
    const auto before = settings();
    const auto now = settings(replace, with);
    try {
      check_resumable(before, now, position, manifest_);
      return "";
    } catch (const UsageError& error) {
      return error.what();
    }
  }

  testing::TemporaryFolder folder_;
  TrainingManifest manifest_;
};

constexpr TrainingPosition kInReconstruction{TrainingPhase::kReconstruction, 1};

TEST_F(Resumption, NamesTheFieldThatDiffers) {
  EXPECT_THAT(refusal(kInReconstruction, "\"batch\": 2", "\"batch\": 4"),
              AllOf(HasSubstr("$.batch: expected 2, got 4"), Not(HasSubstr("$.seed"))));
}

TEST_F(Resumption, ComparesTheTexturesByTheirBytes) {
  settings();
  manifest_.simulated = SimulatedSpec{{"textures"}, 0.5};
  testing::write_file(folder_ / "textures/a.png", "abc");
  const auto before = training_settings(manifest_, {});
  EXPECT_EQ(before.at("textures 0"), sha256_hex("a.png\t" + sha256_hex("abc") + "\n"));
  // What a training draws into an output folder below is no texture, nor is what is no image.
  testing::write_file(folder_ / "textures/out/training.lock", "");
  testing::write_file(folder_ / "textures/out/images/generator-1.png", "abc");
  testing::write_file(folder_ / "textures/read.me", "abc");
  EXPECT_EQ(training_settings(manifest_, {}), before);
  const auto now = [&](const std::string& file, const std::string& bytes) {
    testing::write_file(folder_ / file, bytes);
    return training_settings(manifest_, {});
  };
  for (const char* bytes : {"abd", "abc"}) {  // of the same size; the name alone
    const auto changed =
        now(bytes == std::string("abd") ? "textures/a.png" : "textures/b.png", bytes);
    EXPECT_THROWS(check_resumable(before, changed, kInReconstruction, manifest_), UsageError,
                  "the training in the output folder was started with other");
  }
}

TEST_F(Resumption, ComparesTheTeacher) {
  settings();
  manifest_.teacher = "wide.safetensors";
  const auto with = [&](const std::string& bytes) {
    testing::write_file(folder_ / "wide.safetensors", bytes);
    return training_settings(manifest_, {});
  };
  EXPECT_THROWS(check_resumable(with("abc"), with("abd"), kInReconstruction, manifest_), UsageError,
                "the training in the output folder was started with other");
}

TEST_F(Resumption, ComparesTheRecordingsByTheirBytes) {
  auto before = settings();
  const auto now = before;
  EXPECT_EQ(before.at("recording 0"), sha256_of_file(folder_ / "bar.hdf5"));
  before["recording 0"] = sha256_hex("another of the same size");
  EXPECT_THROWS(check_resumable(before, now, kInReconstruction, manifest_), UsageError,
                "the training in the output folder was started with other");
}

TEST_F(Resumption, ComparesTheImagesOfARecordingInAFolder) {
  settings();
  testing::write_file(folder_ / "ecd/events.txt", "0.1 1 1 1\n");
  testing::write_file(folder_ / "ecd/images.txt", "0.1 images/a.png\n");
  testing::write_file(folder_ / "ecd/images/a.png", "abc");
  manifest_.recordings.resize(1);
  manifest_.recordings[0] = RecordingSpec();
  manifest_.recordings[0].format = RecordingFormat::kEcd;
  std::vector<TrainingRecording> recordings(1);
  recordings[0].file = folder_ / "ecd";
  const auto before = training_settings(manifest_, recordings);
  testing::write_file(folder_ / "ecd/images/a.png", "abd");
  EXPECT_NE(training_settings(manifest_, recordings).at("recording 0"), before.at("recording 0"));
}

TEST_F(Resumption, LetsOutputCommentsAndStepsThatAreNotReachedChange) {
  EXPECT_EQ(refusal(kInReconstruction, "\"image_minutes\": 1000", "\"image_minutes\": 1"), "");
  EXPECT_EQ(refusal(kInReconstruction, "\"directory\": \"out\"", "\"directory\": \"moved\""), "");
  EXPECT_EQ(refusal(kInReconstruction, "{", "{ // a comment\n"), "");
  EXPECT_EQ(refusal(kInReconstruction, "\"generator\": 4", "\"generator\": 9"), "");
  EXPECT_EQ(refusal(kInReconstruction, "\"reconstruction\": 2", "\"reconstruction\": 5"), "");
  EXPECT_THAT(refusal(kInReconstruction, "\"flow\": 2", "\"flow\": 3"), HasSubstr("$.steps.flow"));
  // Fewer than are done.
  EXPECT_THAT(refusal({TrainingPhase::kGenerator, 4}, "\"generator\": 4", "\"generator\": 3"),
              HasSubstr("$.steps.generator"));
}

TEST_F(Resumption, FallingRatesFixThePhaseInProgress) {
  const std::string rate = "\"generator_rate\": 1e-3";
  const auto before = settings(rate, rate + ", \"final_rate_fraction\": 0.1");
  auto now = before;
  now["manifest $.steps.reconstruction"] = "5";
  manifest_.steps.reconstruction = 5;
  EXPECT_THROWS(check_resumable(before, now, kInReconstruction, manifest_), UsageError,
                "the training in the output folder was started with other");
  now = before;
  now["manifest $.steps.generator"] = "9";
  EXPECT_NO_THROW(check_resumable(before, now, kInReconstruction, manifest_));
}

TEST_F(Resumption, AFallingOutputSlopeFixesTheGeneratorsPhaseInProgress) {
  const TrainingPosition in_generator{TrainingPhase::kGenerator, 1};
  EXPECT_EQ(refusal(in_generator, "\"generator\": 4", "\"generator\": 9"), "");
  const auto before = settings();
  manifest_.network.output_slope = 0.1;
  auto now = before;
  now["manifest $.steps.generator"] = "9";
  manifest_.steps.generator = 9;
  EXPECT_THROWS(check_resumable(before, now, in_generator, manifest_), UsageError,
                "the training in the output folder was started with other");
  EXPECT_NO_THROW(check_resumable(before, now, kInReconstruction, manifest_));
}

TEST_F(Resumption, FadingLossesFixTheGeneratorsPhaseInProgress) {
  const TrainingPosition in_generator{TrainingPhase::kGenerator, 1};
  const auto before = settings();
  auto now = before;
  now["manifest $.steps.generator"] = "9";
  manifest_.steps.generator = 9;
  manifest_.losses.volume = 10;
  EXPECT_NO_THROW(check_resumable(before, now, in_generator, manifest_));
  manifest_.network.sensor = true;  // volume, count and overlap fade over the steps
  EXPECT_THROWS(check_resumable(before, now, in_generator, manifest_), UsageError,
                "the training in the output folder was started with other");
  manifest_.losses.volume = 0;
  EXPECT_NO_THROW(check_resumable(before, now, in_generator, manifest_));
}

TrainingCheckpoint checkpoint_at(std::int64_t step) {
  TrainingCheckpoint checkpoint;
  checkpoint.position = {TrainingPhase::kReconstruction, step};
  checkpoint.seconds = 12.5;
  checkpoint.settings = {{"manifest $.batch", "2"}};
  checkpoint.environment = {{"threads", "1"}};
  checkpoint.state["flow.head"] = {{2}, {0.5f, -1e-30f}};
  return checkpoint;
}

class CheckpointFolder : public ::testing::Test {
 protected:
  std::optional<TrainingCheckpoint> load() {
    return load_checkpoint(folder_.path(),
                           [&](const std::string& text) { warnings_.push_back(text); });
  }

  testing::TemporaryFolder folder_;
  std::vector<std::string> warnings_;
};

TEST_F(CheckpointFolder, GivesBackWhatWasSaved) {
  save_checkpoint(folder_.path(), checkpoint_at(7));
  const auto loaded = load();
  ASSERT_TRUE(loaded);
  EXPECT_EQ(loaded->position, (TrainingPosition{TrainingPhase::kReconstruction, 7}));
  EXPECT_EQ(loaded->seconds, 12.5);
  EXPECT_EQ(loaded->settings, checkpoint_at(7).settings);
  EXPECT_EQ(loaded->environment, checkpoint_at(7).environment);
  EXPECT_EQ(loaded->state.at("flow.head").values, checkpoint_at(7).state.at("flow.head").values);
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(CheckpointFolder, IsEmptyAtFirst) {
  EXPECT_FALSE(load());
  EXPECT_TRUE(last_checkpoint(folder_.path()).empty());
}

TEST_F(CheckpointFolder, KeepsTheOneBefore) {
  for (const int step : {1, 2, 3}) save_checkpoint(folder_.path(), checkpoint_at(step));
  EXPECT_EQ(load()->position.step, 3);
  testing::write_file(folder_ / "latest.safetensors", "damaged");
  EXPECT_EQ(load()->position.step, 2);
  ASSERT_THAT(warnings_, SizeIs(1));
  EXPECT_THAT(warnings_[0], HasSubstr("latest.safetensors"));
}

TEST_F(CheckpointFolder, GoesOnFromThePreviousWhereASaveWasCutShort) {
  save_checkpoint(folder_.path(), checkpoint_at(1));
  std::filesystem::rename(folder_ / "latest.safetensors", folder_ / "previous.safetensors");
  EXPECT_EQ(load()->position.step, 1);
  EXPECT_EQ(last_checkpoint(folder_.path()), folder_ / "previous.safetensors");
}

TEST_F(CheckpointFolder, SaysThatAllAreDamaged) {
  save_checkpoint(folder_.path(), checkpoint_at(1));
  testing::write_file(folder_ / "latest.safetensors", "");
  EXPECT_THROWS(load(), std::runtime_error,
                "expected a whole checkpoint, got a damaged one and no");
  testing::write_file(folder_ / "previous.safetensors", "x");
  EXPECT_THROWS(load(), std::runtime_error, "expected a whole checkpoint, got damaged ones");
}

TEST_F(CheckpointFolder, ATruncatedFileIsDamaged) {
  save_checkpoint(folder_.path(), checkpoint_at(1));
  save_checkpoint(folder_.path(), checkpoint_at(2));
  const std::string bytes = testing::read_file(folder_ / "latest.safetensors");
  testing::write_file(folder_ / "latest.safetensors", bytes.substr(0, bytes.size() - 1));
  EXPECT_EQ(load()->position.step, 1);
}

TEST_F(CheckpointFolder, OneFlippedBitAnywhereIsDamage) {
  save_checkpoint(folder_.path(), checkpoint_at(1));
  save_checkpoint(folder_.path(), checkpoint_at(3));
  const std::string whole = testing::read_file(folder_ / "latest.safetensors");
  const auto previous = testing::read_file(folder_ / "previous.safetensors");
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string bytes = whole;
    bytes[i] = static_cast<char>(bytes[i] ^ (1 << (i % 8)));
    testing::write_file(folder_ / "latest.safetensors", bytes);
    const auto loaded = load();
    ASSERT_TRUE(loaded);
    // A blank of the header may become another one: nothing it says has changed.
    const bool same =
        loaded->position.step == 3 &&
        loaded->state.at("flow.head").values == checkpoint_at(3).state.at("flow.head").values;
    EXPECT_TRUE(loaded->position.step == 1 || (same && whole[i] == ' ')) << "byte " << i;
  }
  EXPECT_EQ(testing::read_file(folder_ / "previous.safetensors"), previous);
}

TEST_F(CheckpointFolder, ADamagedOneNeverTakesTheGoodOnesPlace) {
  save_checkpoint(folder_.path(), checkpoint_at(1));
  save_checkpoint(folder_.path(), checkpoint_at(2));
  testing::write_file(folder_ / "latest.safetensors", "damaged");
  EXPECT_EQ(load()->position.step, 1);
  EXPECT_EQ(testing::read_file(folder_ / "damaged.safetensors"), "damaged");
  save_checkpoint(folder_.path(), checkpoint_at(2));
  testing::write_file(folder_ / "latest.safetensors", "damaged again");
  EXPECT_EQ(load()->position.step, 1);
}

TEST_F(CheckpointFolder, AStateThatIsNotFinitePushesNothingOut) {
  save_checkpoint(folder_.path(), checkpoint_at(1));
  TrainingCheckpoint broken = checkpoint_at(2);
  broken.state["flow.head"].values[1] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THROWS(save_checkpoint(folder_.path(), broken), std::runtime_error,
                "expected finite numbers, got others, in tensor flow.head");
  EXPECT_EQ(load()->position.step, 1);
  EXPECT_THAT(warnings_, IsEmpty());
}

}  // namespace
}  // namespace eventgan
