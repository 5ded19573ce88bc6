#include "pipeline/training/records/training_settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/pipeline/training/small_training.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

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

TEST_F(Resumption, ComparesTheRecordings) {
  auto before = settings();
  const auto now = before;
  EXPECT_THAT(before.at("recording 0"), HasSubstr("9 frames of 64x56"));
  before["recording 0"] = "1 bytes, 9 frames of 64x56";
  EXPECT_THROW(check_resumable(before, now, kInReconstruction, manifest_), UsageError);
}

TEST_F(Resumption, LetsOutputAndCommentsChange) {
  EXPECT_EQ(refusal(kInReconstruction, "\"picture_minutes\": 1000", "\"picture_minutes\": 1"), "");
  EXPECT_EQ(refusal(kInReconstruction, "\"directory\": \"out\"", "\"directory\": \"moved\""), "");
  EXPECT_EQ(refusal(kInReconstruction, "{", "{ // a comment\n"), "");
}

TEST_F(Resumption, LetsStepsThatAreNotReachedChange) {
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
  EXPECT_THROW(check_resumable(before, now, kInReconstruction, manifest_), UsageError);
  now = before;
  now["manifest $.steps.generator"] = "9";
  EXPECT_NO_THROW(check_resumable(before, now, kInReconstruction, manifest_));
}

}  // namespace
}  // namespace eventgan
