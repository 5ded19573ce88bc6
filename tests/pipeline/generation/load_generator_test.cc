#include "pipeline/generation/load_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/faults.h"
#include "stages/files/sha256.h"
#include "stages/generator/untrained.h"
#include "stages/generator/weights_files/shipped_weights.h"
#include "stages/generator/weights_files/weights_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(LoadGenerator, ReadsAFileBesideTheManifest) {
  const testing::TemporaryFolder folder;
  const std::string bytes = serialize_weights(untrained_weights(1, 9, 1));
  testing::write_file(folder / "w.safetensors", bytes);
  JobManifest manifest;
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.generator->bins(), 9);
  EXPECT_EQ(loaded.weights_hash, sha256_hex(bytes));
  EXPECT_EQ(loaded.warning, "");
  manifest.volume.bins = 5;
  EXPECT_THROW(load_generator(manifest), UsageError);
}

TEST(LoadGenerator, WarnsLoudlyOfAnUntrainedOne) {
  JobManifest manifest;
  manifest.generator.weights = "untrained:2";
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_THAT(loaded.warning, ::testing::HasSubstr("UNTRAINED"));
  manifest.seed = 1;
  EXPECT_NE(load_generator(manifest).weights_hash, loaded.weights_hash);
}

TEST(LoadGenerator, SetsUpSimulators) {
  JobManifest manifest;
  manifest.volume.bins = 5;
  manifest.generator.kind = GeneratorKind::kDifference;
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.generator->bins(), 5);
  EXPECT_EQ(loaded.warning, "");
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
  EXPECT_EQ(loaded.warning, "");
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
