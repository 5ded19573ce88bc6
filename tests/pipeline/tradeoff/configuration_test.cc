#include "pipeline/tradeoff/configuration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "manifests/documents/job_manifest.h"
#include "manifests/values/faults.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;

constexpr auto kNetwork = GeneratorKind::kNetwork;

std::vector<std::string> names(const std::vector<Computation>& all) {
  std::vector<std::string> result;
  for (const Computation& computation : all) result.push_back(name_of(computation));
  return result;
}

TEST(Computations, AScopeIsTheNetworksAlone) {
  TradeoffAxes axes;
  axes.methods = {kNetwork, GeneratorKind::kDifference};
  axes.weights = {"shipped:8"};
  axes.precisions = {Precision::kInt8};
  axes.sizes = {1};
  axes.scopes = {Scope::kWhole, Scope::kMotion};
  EXPECT_THAT(names(computations(axes)),
              ElementsAre("shipped:8 int8 x1", "shipped:8 int8 motion x1", "difference x1"));
}

TEST(Computations, AreEveryCombinationAndASimulatorHasSizesAlone) {
  TradeoffAxes axes;
  axes.methods = {kNetwork, GeneratorKind::kEsim};
  axes.weights = {"shipped:8", "my.safetensors"};
  axes.precisions = {Precision::kFloat32, Precision::kInt8};
  axes.sizes = {1, 0.75};
  axes.dtypes = {StoredType::kUint8};
  EXPECT_THAT(names(computations(axes)),
              ElementsAre("shipped:8 float32 x1", "shipped:8 float32 x0.75", "shipped:8 int8 x1",
                          "shipped:8 int8 x0.75", "my.safetensors float32 x1",
                          "my.safetensors float32 x0.75", "my.safetensors int8 x1",
                          "my.safetensors int8 x0.75", "esim x1", "esim x0.75"));
}

JobManifest manifest_with(const std::string& image, const std::string& generator) {
  return parse_job_manifest(R"({ // a comment
    "format": "eventgan-manifest", "version": 1, "name": "job",
    "sources": [{ "dataset": "frames", "root": "clip",
                  "pairs": { "gaps": [1], "side": "before", "choose": "one" } }],
    "image": )" + image + R"(, "generator": )" +
                                generator + R"(,
    "output": { "directory": "out", "deflate_level": 3 } })",
                            "/jobs", "manifest.json");
}

TEST(TrialJob, HasTheConfigurationsKeysAndAllOthersOfTheManifest) {
  const JobManifest manifest =
      manifest_with(R"({ "width": 101, "height": 40, "fit": "crop", "preset": "kitti" })",
                    R"({ "weights": "shipped", "engine": "torch" })");
  const TrialJob trial =
      trial_job(manifest, {{kNetwork, "shipped:8", Precision::kInt8, 0.5}, StoredType::kUint8}, {});
  EXPECT_EQ(trial.manifest.image.size, (ImageSize{20, 51}));  // 50.5 rounded away from zero
  EXPECT_EQ(trial.manifest.image.fit, ImageFit::kCrop);
  EXPECT_EQ(trial.manifest.generator.weights, "shipped:8");
  EXPECT_EQ(trial.manifest.generator.precision, Precision::kInt8);
  EXPECT_EQ(trial.manifest.generator.engine, Engine::kTorch);
  EXPECT_EQ(trial.manifest.output.dtype, StoredType::kUint8);
  EXPECT_EQ(trial.manifest.output.deflate_level, 3);
  EXPECT_EQ(trial.manifest.directory, manifest.directory);
  EXPECT_THAT(
      trial.lines,
      ElementsAre(
          R"("image": {"width":51,"height":20,"fit":"crop","preset":"kitti"})",
          R"("generator": {"weights":"shipped:8","engine":"torch","precision":"int8","scope":"whole"})",
          R"("output": {"directory":"out","deflate_level":3,"dtype":"uint8"})"));
}

TEST(TrialJob, OfSizeOneLeavesTheImageAloneAndOfAnotherNeedsToKnowTheVolumes) {
  const JobManifest manifest = manifest_with(R"({ "preset": "mpii" })", "{}");
  const TrialJob trial = trial_job(manifest, {{kNetwork, "shipped:8"}, StoredType::kFloat32}, {});
  EXPECT_EQ(trial.manifest.image.size, std::nullopt);
  EXPECT_EQ(trial.lines.size(), 2u);
  const Configuration half{{kNetwork, "shipped:8", Precision::kFloat32, 0.5}, StoredType::kUint8};
  EXPECT_EQ(trial_job(manifest, half, ImageSize{100, 60}).manifest.image.size, (ImageSize{50, 30}));
  EXPECT_THROWS(trial_job(manifest, half, std::nullopt), UsageError,
                "size: expected images of one size, or $.image.width and");
  EXPECT_THROWS(trial_job(manifest, half, ImageSize{100, 30}), UsageError,
                "shipped:8 float32 x0.5 uint8: $.image.width: expected an");  // 15 pixels
}

TEST(TrialJob, SimulatorsHaveTheManifestsSensorIfItHasOne) {
  const JobManifest simulated = manifest_with(
      R"({ "preset": "mpii" })",
      R"({ "kind": "esim", "sensor": { "positive_threshold": 0.4 }, "max_displacement_px": 3 })");
  const Configuration difference{{GeneratorKind::kDifference, ""}, StoredType::kUint8};
  const JobManifest as_difference = trial_job(simulated, difference, {}).manifest;
  EXPECT_EQ(as_difference.generator.kind, GeneratorKind::kDifference);
  EXPECT_EQ(as_difference.generator.sensor.positive_threshold, 0.4);
  const Configuration network{{kNetwork, "shipped:8"}, StoredType::kUint8};
  EXPECT_EQ(trial_job(simulated, network, {}).manifest.generator.kind, kNetwork);

  const JobManifest learned =
      manifest_with(R"({ "preset": "mpii" })", R"({ "weights": "shipped", "precision": "int8" })");
  const TrialJob trial = trial_job(learned, difference, {});
  EXPECT_EQ(trial.manifest.generator.kind, GeneratorKind::kDifference);
  EXPECT_EQ(trial.lines.front(), R"("generator": {"kind":"difference"})");
}

}  // namespace
}  // namespace eventgan
