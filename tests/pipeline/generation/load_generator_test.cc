#include "pipeline/generation/load_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "manifests/faults.h"
#include "pipeline/generation/engine_support.h"
#include "stages/files/sha256.h"
#include "stages/generator/untrained.h"
#include "stages/generator/weights_files/shipped_weights.h"
#include "stages/generator/weights_files/weights_file.h"
#include "tests/stages/generator/calibration/sample_calibration.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

/// Weights that do not say of themselves that they are untrained.
Weights trained_weights() {
  Weights weights = untrained_weights(1, 9, 1);
  weights.metadata["origin"] = "a test";
  return weights;
}

TEST(LoadGenerator, ReadsAFileBesideTheManifest) {
  const testing::TemporaryFolder folder;
  const std::string bytes = serialize_weights(trained_weights());
  testing::write_file(folder / "w.safetensors", bytes);
  JobManifest manifest;
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.generator->bins(), 9);
  EXPECT_EQ(loaded.weights_hash, sha256_hex(bytes));
  EXPECT_THAT(loaded.warnings, ::testing::IsEmpty());
  manifest.volume.bins = 5;
  EXPECT_THROW(load_generator(manifest), UsageError);
}

TEST(LoadGenerator, WarnsLoudlyOfAnUntrainedOne) {
  JobManifest manifest;
  manifest.generator.weights = "untrained:2";
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_THAT(loaded.warnings, ::testing::ElementsAre(::testing::HasSubstr("UNTRAINED")));
  manifest.seed = 1;
  EXPECT_NE(load_generator(manifest).weights_hash, loaded.weights_hash);
}

TEST(LoadGenerator, WarnsOfAnUntrainedOneFromAFileToo) {
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "w.safetensors", serialize_weights(untrained_weights(1, 9, 1)));
  JobManifest manifest;
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  EXPECT_THAT(load_generator(manifest).warnings,
              ::testing::ElementsAre(::testing::HasSubstr("UNTRAINED (w.safetensors)")));
}

TEST(LoadGenerator, MakesTheEngineThatIsAskedForAndSaysWhich) {
  JobManifest manifest;
  manifest.generator.weights = "untrained:1";
  manifest.generator.engine = Engine::kTorch;
  const LoadedGenerator torch = load_generator(manifest);
  EXPECT_THAT(torch.choice, ::testing::StartsWith("generator: torch float32 on "));
  EXPECT_THAT(torch.choice, ::testing::EndsWith(
                                "(as the manifest says), training gaps unknown, so none is marked "
                                "as extrapolated"));
  EXPECT_THAT(torch.generator->description(), ::testing::StartsWith("torch float32"));

  manifest.generator.engine = std::nullopt;
  const EngineSupport support = engine_support(Precision::kFloat32);
  const LoadedGenerator fastest = load_generator(manifest);
  const std::string name = support.onednn_able ? "onednn float32" : "torch float32";
  EXPECT_THAT(fastest.choice, ::testing::StartsWith("generator: " + name + " on " +
                                                    support.processor + " (auto: "));
  EXPECT_THAT(fastest.generator->description(), ::testing::StartsWith(name));
}

TEST(LoadGenerator, KnowsWhatGapsTheWeightsWereTrainedOn) {
  const testing::TemporaryFolder folder;
  Weights weights = trained_weights();
  weights.training_gaps = GapRange{1, 5};
  testing::write_file(folder / "w.safetensors", serialize_weights(weights));
  JobManifest manifest;
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  for (const std::optional<Engine> engine : {std::optional<Engine>(), {Engine::kTorch}}) {
    manifest.generator.engine = engine;
    const LoadedGenerator loaded = load_generator(manifest);
    EXPECT_EQ(loaded.generator->training_gaps(), (GapRange{1, 5}));
    EXPECT_THAT(loaded.choice, ::testing::EndsWith(", trained on gaps 1-5"));
    EXPECT_THAT(loaded.generator->description(), ::testing::EndsWith(", trained on gaps 1-5"));
  }
}

TEST(LoadGenerator, RefusesInt8WithoutACalibration) {
  JobManifest manifest;
  manifest.generator.weights = "untrained:1";
  manifest.generator.precision = Precision::kInt8;
  EXPECT_THROW(load_generator(manifest), UsageError);
}

TEST(LoadGenerator, RefusesWeightsThatInt8CannotServe) {
  if (!engine_support(Precision::kInt8).onednn_able) GTEST_SKIP() << "no int8 here";
  const testing::TemporaryFolder folder;
  Weights weights = trained_weights();
  weights.calibration = std::make_shared<const Calibration>(testing::sample_calibration(1, 1));
  JobManifest manifest;
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  manifest.generator.precision = Precision::kInt8;
  testing::write_file(folder / "w.safetensors", serialize_weights(weights));
  EXPECT_THAT(load_generator(manifest).choice, ::testing::StartsWith("generator: onednn int8 on "));
  weights.convolutions[2].bias[0] = std::numeric_limits<float>::max();
  testing::write_file(folder / "w.safetensors", serialize_weights(weights));
  EXPECT_THROW(load_generator(manifest), InputError);
}

TEST(LoadGenerator, SetsUpSimulators) {
  JobManifest manifest;
  manifest.volume.bins = 5;
  manifest.generator.kind = GeneratorKind::kDifference;
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.generator->bins(), 5);
  EXPECT_EQ(loaded.generator->training_gaps(), std::nullopt);
  EXPECT_THAT(loaded.warnings, ::testing::IsEmpty());
  EXPECT_EQ(loaded.choice, "");
  EXPECT_EQ(loaded.weights_hash, sha256_hex(loaded.generator->description()));
  manifest.generator.kind = GeneratorKind::kEsim;
  EXPECT_NE(load_generator(manifest).weights_hash, loaded.weights_hash);
}

TEST(LoadGenerator, FindsTheShippedWeightsOrSaysThatThereAreNone) {
  JobManifest manifest;
  EXPECT_EQ(manifest.generator.weights, "shipped");
  if (shipped_widths().empty()) {
    EXPECT_THROW(load_generator(manifest), InputError);
    return;
  }
  const int width = default_shipped_width();
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.weights_hash, sha256_hex(shipped_weights_bytes(width)));
  EXPECT_THAT(loaded.warnings, ::testing::IsEmpty());
  manifest.generator.weights = "shipped:" + std::to_string(width);
  EXPECT_EQ(load_generator(manifest).weights_hash, loaded.weights_hash);
  manifest.generator.weights = "shipped:63";
  EXPECT_THROW(load_generator(manifest), InputError);
}

TEST(LoadGenerator, RefusesAMissingFileAndAWidthThatIsNone) {
  JobManifest manifest;
  manifest.directory = "/nowhere";
  manifest.generator.weights = "w.safetensors";
  EXPECT_THROW(load_generator(manifest), InputError);
  for (const char* weights :
       {"untrained:", "untrained:0", "untrained:8x", "untrained:1000", "shipped:", "shipped:0"}) {
    manifest.generator.weights = weights;
    EXPECT_THROW(load_generator(manifest), UsageError) << weights;
  }
}

}  // namespace
}  // namespace eventgan
