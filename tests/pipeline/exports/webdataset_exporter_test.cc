#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "manifests/values/faults.h"
#include "pipeline/exports/export_job.h"
#include "stages/base/archives/numpy_arrays.h"
#include "stages/base/archives/zip_archive.h"
#include "tests/pipeline/exports/exporters_fixture.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using testing::Exporters;
using ::testing::HasSubstr;
using testing::kPixels;
using testing::npy;
using testing::tar_content;

TEST_F(Exporters, WebdatasetHasTheVolumeAsItIsStored) {
  const std::filesystem::path tar = exported("webdataset") / "demo-val-00000-of-00001.tar";
  testing::write_file(folder_ / "a.npz", tar_content(tar, "000003.npz"));
  const ZipArchive arrays(folder_ / "a.npz");
  const std::vector<std::byte> stored = arrays.read("volume.npy");
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(stored.data()), stored.size()),
            stored_volume(3));
  EXPECT_EQ(parse_npy(arrays.read("scale.npy"), "scale").number(0), 1);
  EXPECT_EQ(tar_content(tar, "000002.json"), "") << "in quarantine";
}

TEST_F(Exporters, WebdatasetHasWhatTheEventsOfTheVolumeBecome) {
  ExportOptions options;
  options.representation = "count";
  const std::filesystem::path tar = exported("webdataset", options) / "demo-val-00000-of-00001.tar";
  testing::write_file(folder_ / "a.npz", tar_content(tar, "000004.npz"));
  const ZipArchive arrays(folder_ / "a.npz");
  const auto counts = parse_npy(arrays.read("representation.npy"), "counts");
  EXPECT_THAT(counts.shape, ElementsAre(2u, 6u, 8u));
  double sum = 0;
  for (std::size_t i = 0; i < 2 * kPixels; ++i) sum += counts.number(i);
  EXPECT_EQ(sum, static_cast<double>(event_count(4)));
  EXPECT_FALSE(arrays.contains("volume.npy"));
  EXPECT_TRUE(arrays.contains("flow.npy"));
}

TEST_F(Exporters, WebdatasetDrawsNoEventsOfVolumesAsStored) {
  ExportOptions options;
  options.seed = 5;
  EXPECT_THAT([&] { exported("webdataset", options); },
              ThrowsMessage<UsageError>(HasSubstr("expected --representation WORD beside them")));
}

TEST_F(Exporters, WebdatasetKnowsTheWordsOfRepresentations) {
  ExportOptions options;
  options.representation = "histogram:65";
  EXPECT_THAT([&] { exported("webdataset", options); },
              ThrowsMessage<UsageError>(HasSubstr("\"histogram:65\"")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "webdataset"));
}

/// A place in a sample's JSON, and what is there.
struct WebdatasetCase {
  const char* sample;
  const char* place;
  const char* expected;
};

constexpr WebdatasetCase kWebdatasetCases[] = {
    {"000000", "/split", R"("val")"},
    {"000000", "/action", "null"},  // which others have
    {"000003", "/action", R"("Walking-1")"},
    {"000000", "/prev_video_frame", "null"},
    {"000003", "/prev_video_frame", "10"},
    {"000000", "/prev_time_s", "1.0"},
    {"000001", "/next_time_s", "null"},
    {"000001", "/gap_s", "null"},
    {"000000", "/source_size", "[12, 16]"},
    {"000000", "/source_to_volume", "[[0.5, 0.0, -0.25], [0.0, 0.5, -0.25]]"},
    {"000000", "/motion", "null"},
    {"000004", "/motion", "[-1.5, 0.25, 0.75, 1.0078125]"},
    {"000004", "/threshold", "0.3125"},
    {"000003", "/threshold", "null"},
    {"000000", "/projection",
     "[[350.0, 0.0, 3.75, 19.0], [0.0, 350.0, 2.75, 0.0], [0.0, 0.0, 1.0, 4.0]]"},
    {"000003", "/projection_source", "null"},
    {"000001", "/boxes", "[]"},
    {"000000", "/boxes/0/class", R"("Car")"},
    {"000000", "/boxes/0/xyxy", "[1.0, 1.0, 4.25, 4.5]"},
    {"000000", "/boxes/0/outline",
     "[[1, 1, 4.25, 1, 4.25, 4.5, 1, 4.5], [2, 2, 2, 3, 3, 3, 3, 2]]"},
    {"000000", "/boxes/0/occlusion", "0"},
    {"000000", "/boxes/0/track_id", "7"},
    {"000000", "/boxes/0/difficulty", "1"},
    {"000000", "/boxes/0/ignore", "false"},
    {"000000", "/boxes/0/motion", "null"},
    {"000000", "/boxes/1/ignore_source", "true"},
    {"000000", "/boxes/1/truncation", "null"},
    {"000000", "/boxes/1/occlusion", "null"},
    {"000000", "/boxes/1/alpha", "null"},
    {"000000", "/boxes/1/box3d", "null"},
    {"000000", "/boxes/1/track_id", "null"},
    {"000000", "/boxes/1/difficulty", "null"},
    {"000000", "/boxes/1/outline", "null"},
    {"000003", "/boxes/0/motion", "[0.5, -2.25, 1.5, 0.984375]"},
    {"000000", "/joint_names", R"(["nose", "left hand", "right hand"])"},
    {"000000", "/joint_aliases", R"(["", "left_wrist", "right_wrist"])"},
    {"000000", "/persons/0/joints", "[[1.5, 1.75], [2.25, 2.875], null]"},
    {"000000", "/persons/0/visible", "[1, 0, 0]"},
    {"000000", "/persons/0/center", "null"},
    {"000000", "/persons/0/scale", "null"},
    {"000000", "/persons/0/scale_volume", "null"},
    {"000000", "/persons/0/head_box_source", "null"},
    {"000000", "/persons/0/box", "null"},
    {"000000", "/persons/0/joints3d_mm", "null"},
    {"000000", "/persons/0/camera", "null"},
    {"000000", "/persons/1/visible", "[1, 0, null]"},
    {"000000", "/persons/1/joints_source", "[[3.5, 4.0], [5.0, 6.25], [7.0, 7.0]]"},
    {"000000", "/persons/1/scale_volume", "0.875"},
    {"000000", "/persons/1/head_box", "[0.5, 1.0, 2.5, 3.25]"},
    {"000000", "/persons/1/joints3d_mm", "[null, [4.0, 5.0, 3001.0], [7.0, 8.0, 3002.0]]"},
    {"000000", "/persons/1/camera_distortion", "[-0.2071, 0.2478, -0.0031, -0.0014, -0.001]"}};

TEST_F(Exporters, WebdatasetHasEveryColumnWithNullForWhatIsUnknown) {
  const std::filesystem::path tar = exported("webdataset") / "demo-val-00000-of-00001.tar";
  for (const auto& [sample, place, expected] : kWebdatasetCases) {
    SCOPED_TRACE(std::string(sample) + place);
    const json labels = json::parse(tar_content(tar, std::string(sample) + ".json"));
    const json::json_pointer pointer(place);
    ASSERT_TRUE(labels.contains(pointer));
    EXPECT_EQ(labels[pointer], json::parse(expected));
  }
}

}  // namespace
}  // namespace eventgan
