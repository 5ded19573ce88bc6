#include "stages/training/check_trainable.h"

#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "tests/stages/training/small_training.h"

namespace eventgan {
namespace {

TEST(CheckTrainable, RefusesCropsTooSmallForTheDiscriminator) {
  TrainingManifest manifest = testing::small_training();
  EXPECT_NO_THROW(check_trainable(manifest));
  manifest.crop = {47, 48};
  EXPECT_THROW(check_trainable(manifest), UsageError);
  manifest.crop = {48, 47};
  EXPECT_THROW(check_trainable(manifest), UsageError);
  manifest.losses.adversarial = 0;
  EXPECT_NO_THROW(check_trainable(manifest));
}

TEST(CheckTrainable, RefusesABatchWithoutHalves) {
  TrainingManifest manifest = testing::small_training();
  manifest.batch = 3;
  EXPECT_THROW(check_trainable(manifest), UsageError);
  manifest.losses.adversarial = 0;
  EXPECT_NO_THROW(check_trainable(manifest));
}

TEST(CheckTrainable, RefusesAGeneratorWithoutLoss) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses = {.adversarial = 0, .flow = 0, .reconstruction = 0};
  EXPECT_THROW(check_trainable(manifest), UsageError);
  manifest.steps.generator = 0;
  EXPECT_NO_THROW(check_trainable(manifest));
}

TEST(CheckTrainable, RefusesOnePixelForBatchNorm) {
  TrainingManifest manifest = testing::small_training();
  manifest.losses.adversarial = 0;
  manifest.crop = {16, 16};
  EXPECT_NO_THROW(check_trainable(manifest));
  manifest.batch = 1;
  EXPECT_THROW(check_trainable(manifest), UsageError);
  manifest.crop = {17, 16};
  EXPECT_NO_THROW(check_trainable(manifest));
}

}  // namespace
}  // namespace eventgan
