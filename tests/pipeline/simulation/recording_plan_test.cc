#include "pipeline/simulation/recording_plan.h"

#include <gtest/gtest.h>

#include "tests/pipeline/simulation/moving_clip.h"
#include "tests/testing/temporary_folder.h"

namespace eventgan {
namespace {

std::vector<PlannedRecording> plan(const testing::TemporaryFolder& folder,
                                   const std::string& source) {
  const SimulationManifest manifest = testing::moving_clip_manifest(folder.path(), source);
  const ClipFrames clip(manifest.sources.at(0), manifest);
  return plan_recordings(manifest, manifest.sources.at(0), clip, "/out");
}

TEST(RecordingPlan, AClipIsOneRecording) {
  const testing::TemporaryFolder folder;
  testing::write_moving_clip(folder / "clip", {16, 16}, 4);
  const auto recordings = plan(folder, R"({"path": "clip", "name": "a"})");
  ASSERT_EQ(recordings.size(), 1u);
  EXPECT_EQ(recordings[0].file, "/out/a.hdf5");
  EXPECT_EQ(recordings[0].frame_count, 4);
  EXPECT_EQ(recordings[0].picture, std::nullopt);
}

TEST(RecordingPlan, APictureIsOneEach) {
  const testing::TemporaryFolder folder;
  testing::write_moving_clip(folder / "clip", {16, 16}, 4);
  const auto recordings = plan(
      folder, R"({"path": "clip", "method": "affine", "frame_step": 3, "frames_per_picture": 9})");
  ASSERT_EQ(recordings.size(), 2u);
  EXPECT_EQ(recordings[0].name, "clip-000");
  EXPECT_EQ(recordings[1].file, "/out/clip-001.hdf5");
  EXPECT_EQ(recordings[1].picture, 1);  // position, not number
  EXPECT_EQ(recordings[1].frame_count, 9);
  EXPECT_NE(recordings[0].settings, recordings[1].settings);
}

}  // namespace
}  // namespace eventgan
