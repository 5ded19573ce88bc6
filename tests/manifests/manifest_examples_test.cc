#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "manifests/job_manifest.h"
#include "manifests/simulation_manifest.h"
#include "manifests/training_manifest.h"
#include "tests/manifests/json_schema.h"

namespace eventgan {
namespace {

std::filesystem::path examples() {
  return std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "examples";
}

JobManifest example(const std::string& name) { return read_job_manifest(examples() / name); }

TEST(ManifestExamples, AllAreSoundAndMatchTheirSchemas) {
  const std::map<std::string, std::string> schemas = {
      {"eventgan-manifest", "manifest.schema.json"},
      {"eventgan-simulation", "simulation.schema.json"},
      {"eventgan-training", "training.schema.json"}};
  std::map<std::string, int> counts;
  for (const auto& entry : std::filesystem::directory_iterator(examples())) {
    const nlohmann::json document = testing::read_commented_json(entry.path());
    const std::string format = document.at("format");
    ++counts[format];
    EXPECT_TRUE(testing::schema_accepts(schemas.at(format), document)) << entry.path();
    if (format == "eventgan-simulation") {
      EXPECT_NO_THROW(read_simulation_manifest(entry.path())) << entry.path();
    } else if (format == "eventgan-training") {
      EXPECT_NO_THROW(read_training_manifest(entry.path())) << entry.path();
    } else {
      EXPECT_NO_THROW(read_job_manifest(entry.path())) << entry.path();
    }
  }
  EXPECT_EQ(counts.size(), schemas.size());
  EXPECT_GE(counts["eventgan-manifest"], 6);
}

TEST(ManifestExamples, SayWhatTheirNamesSay) {
  EXPECT_EQ(example("kitti.json").sources.at(0).dataset, DatasetKind::kKittiObject);
  EXPECT_EQ(example("kitti_raw_gaps.json").sources.at(0).pairs.gaps.size(), 6u);
  EXPECT_EQ(example("mpii.json").sources.at(0).pairs.side, PairSide::kAround);
  EXPECT_EQ(example("human36m.json").sources.at(0).layout, Human36mLayout::kFetch);
  EXPECT_EQ(example("frames.json").image.size, std::nullopt);
  EXPECT_EQ(example("all.json").sources.size(), 4u);
}

}  // namespace
}  // namespace eventgan
