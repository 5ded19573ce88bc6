#include "manifests/documents/simulation_manifest.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "manifests/values/faults.h"
#include "tests/manifests/documents/json_schema.h"
#include "tests/manifests/documents/manifest_cases.h"

namespace eventgan {
namespace {

using testing::ManifestCase;

constexpr char kSoundSimulation[] = R"({
  "format": "eventgan-simulation", "version": 1, "name": "s",
  "sources": [{"path": "a/clip.mp4"}, {"path": "drive", "method": "affine"}],
  "output": {"directory": "out"}
})";

SimulationManifest parse_simulation(const std::string& text) {
  return parse_simulation_manifest(text, "/data", "d");
}

const ManifestCase kSimulationCases[] = {
    {"as it is", {}, {}},
    {"another format",
     {{"/format", R"("eventgan-manifest")"}},
     {R"($.format: expected "eventgan-simulation", got "eventgan-manifest")"}},
    {"nothing that is required",
     {{"/name", ""}, {"/sources", ""}, {"/output", ""}},
     {"$.name: " + testing::kNameRule + "nothing",
      "$.sources: expected an array of 1 or more, got nothing",
      "$.output: expected an object, got nothing"}},
    {"a source of no kind",
     {{"/sources/0", R"({"path": "", "method": "v2e", "name": "-a", "frames_per_second": 0,
                         "first_frame": -1, "frame_step": 0, "frame_cont": 3})"}},
     {R"($.sources[0].path: expected a path, got "")",
      "$.sources[0].name: " + testing::kNameRule + R"("-a")",
      R"($.sources[0].method: expected "affine", "clip", "difference" or "stills", got "v2e")",
      "$.sources[0].frames_per_second: expected a number 1e-06..1e+06, got 0",
      "$.sources[0].first_frame: expected an integer 0..1000000000, got -1",
      "$.sources[0].frame_step: expected an integer 1..100, got 0",
      R"($.sources[0].frame_cont: expected the key "frame_count" or none, got an unknown key)"}},
    {"keys of affine elsewhere",
     {{"/sources/0/frames_per_image", "7"}, {"/sources/0/max_displacement_px", "1"}},
     {R"($.sources[0].frames_per_image: expected no such key for method "clip" (only for affine), got 7)",
      R"($.sources[0].max_displacement_px: expected no such key for method "clip" (only for affine), got 1)"}},
    {"one image", {{"/sources/1/frame_count", "1"}}, {}},
    {"one still",
     {{"/sources/1", R"({"path": "job.json", "method": "stills", "frame_count": 1})"}},
     {}},
    {"the rate of stills, whose job tells it",
     {{"/sources/1", R"({"path": "job.json", "method": "stills", "frames_per_second": 20})"}},
     {R"($.sources[1].frames_per_second: expected no such key for method "stills" (only for affine, clip, difference), got 20)"}},
    {"a clip of one frame",
     {{"/sources/0/frame_count", "1"}},
     {"$.sources[0].frame_count: expected 0 (to the end) or at least 2 frames, since events lie "
      "between frames, got 1"}},
    {"a path whose stem is no name",
     {{"/sources/0/path", R"("my clip.mp4")"}},
     {"$.sources[0].name: " + testing::kNameRule + "nothing"},
     true},
    {"a name twice",
     {{"/sources/1/name", R"("clip")"}},
     {R"($.sources[1]: expected a name that no other source has, got "clip" again)"},
     true},
    {"the name of an affine recording",
     {{"/sources/0/name", R"("drive-003")"}},
     {R"($.sources[0]: expected a name that no numbered recording of another source has, got "drive-003")"},
     true},
    {"a name with a number", {{"/sources/0/name", R"("clip-003")"}}, {}},
    {"a size", {{"/size", R"({"width": 16, "height": 8192})"}}, {}},
    {"a size that raw holds",
     {{"/size", R"({"width": 2048, "height": 16})"}, {"/output/format", R"("raw")"}},
     {}},
    {"a size beyond raw",
     {{"/size", R"({"width": 16, "height": 2049})"}, {"/output/format", R"("raw")"}},
     {"$.size: expected at most 2048 pixels a side for the format raw, got 16x2049"}},
    {"a size of one side",
     {{"/size", R"({"width": 15})"}},
     {"$.size.height: expected an integer 16..8192, got nothing",
      "$.size.width: expected an integer 16..8192, got 15"}},
    {"a sensor out of range",
     {{"/sensor", R"({"positive_threshold": 0, "refractory_s": "1"})"}},
     {"$.sensor.positive_threshold: expected a number 0.01..5, got 0",
      R"($.sensor.refractory_s: expected a number 0..1, got "1")"}},
};

class SimulationFaults : public ::testing::TestWithParam<ManifestCase> {};

TEST_P(SimulationFaults, AreAllReportedAndSeenByTheSchema) {
  testing::expect_faults(GetParam(), kSoundSimulation, "simulation.schema.json", parse_simulation);
}

INSTANTIATE_TEST_SUITE_P(Table, SimulationFaults, ::testing::ValuesIn(kSimulationCases),
                         [](const auto& entry) { return testing::test_name(entry.param); });

TEST(SimulationManifest, NamesASourceByItsPath) {
  const SimulationManifest manifest = parse_simulation(kSoundSimulation);
  EXPECT_EQ(manifest.sources.at(0).name, "clip");
  EXPECT_EQ(manifest.sources.at(1).name, "drive");
  const std::string named = testing::edited(kSoundSimulation, {{"/sources/0/name", R"("q")"}});
  EXPECT_EQ(parse_simulation(named).sources.at(0).name, "q");
  EXPECT_EQ(resolve(manifest, "a/clip.mp4"), "/data/a/clip.mp4");
}

}  // namespace
}  // namespace eventgan
