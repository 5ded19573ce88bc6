#include "pipeline/simulation/recording_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "manifests/values/faults.h"
#include "pipeline/simulation/recording_output.h"
#include "tests/pipeline/simulation/moving_clip.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

std::string settings(const std::string& source, const std::string& more = "") {
  const SimulationManifest manifest = testing::moving_clip_manifest("/data", source, more);
  return recording_settings(manifest, manifest.sources.at(0), "clip", "hash", std::nullopt);
}

TEST(RecordingSettings, AreTheSourcesAndTheSensorsAlone) {
  const auto json = nlohmann::json::parse(
      settings(R"({"path": "clip", "frame_count": 7})", R"(, "sensor": {"leak_rate_hz": 2})"));
  EXPECT_EQ(json.at("source").at("frame_count"), 7);
  EXPECT_EQ(json.at("sensor").at("leak_rate_hz"), 2);
  EXPECT_EQ(json.at("files"), "hash");
  EXPECT_FALSE(json.contains("size"));
  EXPECT_EQ(settings(R"({"path": "clip"})"), settings(R"({"path": "clip"}, {"path": "other"})"));
  EXPECT_NE(settings(R"({"path": "clip"})"), settings(R"({"path": "clip"})", R"(, "seed": 1)"));
  EXPECT_EQ(settings(R"({"path": "clip", "method": "affine", "frame_count": 1})"),
            settings(R"({"path": "clip", "method": "affine", "frame_count": 9})"));
}

TEST(RecordingSettings, AreReadBackFromARecording) {
  const testing::TemporaryFolder folder;
  const std::string settings = R"({"a<&>": "\u00b5 %"})";
  for (const std::string ending : {".hdf5", ".aedat4", ".raw"}) {
    SCOPED_TRACE(ending);
    EXPECT_EQ(settings_on_disk(folder / ("a" + ending)), std::nullopt);
    const auto output = open_recording_output(folder / ("a" + ending), {2, 3}, settings);
    output->add_frame(GreyImage{{2, 3}, std::vector<std::uint8_t>(6)}, 0, nullptr);
    output->commit({});
    EXPECT_EQ(settings_on_disk(folder / ("a" + ending)), settings);
    for (const char* other : {"", "no recording", "#!AER-DAT4.0\r\n", "% evt 3.0\n% end\n"}) {
      testing::write_file(folder / ("b" + ending), other);
      EXPECT_THROWS(settings_on_disk(folder / ("b" + ending)), InputError,
                    "expected no file, or a recording that eventgan simulate has")
          << other;
    }
  }
}

TEST(RecordingSettings, DifferencesAreToldByField) {
  EXPECT_NO_THROW(check_same_settings("f", "{\"a\": 1}", "{\"a\": 1}"));
  try {
    check_same_settings("f.hdf5", R"({"a": 1, "b": {"c": 2}})", R"({"a": 1, "b": {"c": 3}})");
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), ::testing::AllOf(::testing::StartsWith("f.hdf5 was made by a run"),
                                               ::testing::HasSubstr("$.b.c: expected 2, got 3"),
                                               ::testing::Not(::testing::HasSubstr("$.a"))));
  }
}

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
  EXPECT_EQ(recordings[0].image, std::nullopt);
}

TEST(RecordingPlan, AnImageIsOneEach) {
  const testing::TemporaryFolder folder;
  testing::write_moving_clip(folder / "clip", {16, 16}, 4);
  const auto recordings = plan(
      folder, R"({"path": "clip", "method": "affine", "frame_step": 3, "frames_per_image": 9})");
  ASSERT_EQ(recordings.size(), 2u);
  EXPECT_EQ(recordings[0].name, "clip-000");
  EXPECT_EQ(recordings[1].file, "/out/clip-001.hdf5");
  EXPECT_EQ(recordings[1].image, 1);  // position, not number
  EXPECT_EQ(recordings[1].frame_count, 9);
  EXPECT_NE(recordings[0].settings, recordings[1].settings);
}

}  // namespace
}  // namespace eventgan
