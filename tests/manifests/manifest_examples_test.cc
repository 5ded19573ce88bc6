#include <gtest/gtest.h>

#include <filesystem>

#include "manifests/job_manifest.h"

namespace eventgan {
namespace {

std::filesystem::path examples() {
  return std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "examples";
}

JobManifest example(const std::string& name) { return read_job_manifest(examples() / name); }

TEST(ManifestExamples, AllAreSound) {
  for (const auto& entry : std::filesystem::directory_iterator(examples())) {
    EXPECT_NO_THROW(read_job_manifest(entry.path())) << entry.path();
  }
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
