#include "manifests/documents/job_manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "manifests/documents/manifest_fields.h"
#include "manifests/values/faults.h"
#include "tests/manifests/documents/manifest_cases.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::kSoundManifest;
using testing::ManifestCase;
using ::testing::Pair;

JobManifest parse(const std::string& text) { return parse_job_manifest(text, "/data", "d"); }

std::string faults_of(const std::string& text) {
  try {
    parse(text);
    return "";
  } catch (const UsageError& error) {
    return error.what();
  }
}

class ManifestFaults : public ::testing::TestWithParam<ManifestCase> {};

TEST_P(ManifestFaults, AreAllReportedWithPathExpectedAndGot) {
  testing::expect_faults(GetParam(), kSoundManifest, "manifest.schema.json", parse);
}

INSTANTIATE_TEST_SUITE_P(Table, ManifestFaults, ::testing::ValuesIn(testing::manifest_cases()),
                         [](const auto& entry) { return testing::test_name(entry.param); });

TEST(JobManifest, WithoutAGeneratorHasTheShippedOne) {
  const JobManifest manifest = parse(testing::edited(kSoundManifest, {{"/generator", ""}}));
  EXPECT_EQ(manifest.generator.kind, GeneratorKind::kNetwork);
  EXPECT_EQ(manifest.generator.weights, "shipped");
}

TEST(JobManifest, TakesTheKeysOfTheGeneratorsRow) {
  std::set<std::string> keys;
  for (const GeneratorRow& row : kGenerators) keys.insert(row.keys.begin(), row.keys.end());
  keys.erase("");
  for (const GeneratorRow& row : kGenerators) {
    for (const std::string& key : keys) {
      const std::string generator =
          R"({"kind": ")" + std::string(row.word) + R"(", ")" + key + R"(": null})";
      const std::string faults =
          faults_of(testing::edited(kSoundManifest, {{"/generator", generator}}));
      const std::string at = "$.generator." + key + ": expected ";
      EXPECT_THAT(faults, HasSubstr(at)) << row.word;
      EXPECT_EQ(faults.find("(only for ") == faults.npos, takes(row, key)) << faults;
      EXPECT_EQ(faults.find("an unknown key"), faults.npos) << faults;
    }
  }
}

TEST(JobManifest, HoldsASimulatorsSettings) {
  const GeneratorSpec spec = parse(testing::edited(kSoundManifest, {{"/generator", R"({
    "kind": "esim", "duration_s": 0.03, "max_displacement_px": 4,
    "sensor": {"positive_threshold": 0.3, "leak_rate_hz": 1}})"}}))
                                 .generator;
  EXPECT_EQ(spec.kind, GeneratorKind::kEsim);
  EXPECT_EQ(spec.duration_s, 0.03);
  EXPECT_EQ(spec.max_displacement_px, 4);
  SensorSpec sensor;
  sensor.positive_threshold = 0.3;
  sensor.leak_rate_hz = 1;
  EXPECT_EQ(spec.sensor, sensor);
}

TEST(JobManifest, HoldsThresholdsAndTheSensorAtTheirMiddle) {
  const auto read = [](const char* sensor) {
    const std::string generator = R"({"kind": "esim", "sensor": )" + std::string(sensor) + "}";
    return parse(testing::edited(kSoundManifest, {{"/generator", generator}})).generator;
  };
  EXPECT_EQ(read("{}").threshold, std::nullopt);
  const GeneratorSpec one = read(R"({"threshold": 0.5, "threshold_spread": 0.1})");
  EXPECT_EQ(one.threshold, (ThresholdSpec{.range = {0.5, 0.5}, .spread = 0.1}));
  const GeneratorSpec range = read(R"({"threshold": [0.1, 0.4], "refractory_s": 1})");
  EXPECT_EQ(range.threshold, (ThresholdSpec{.range = {0.1, 0.4}}));
  // The middle is sqrt(0.1 x 0.4) = 0.2, which the defaults have.
  EXPECT_NEAR(range.sensor.positive_threshold, 0.2, 1e-12);
  EXPECT_NEAR(range.sensor.negative_threshold, 0.2, 1e-12);
  EXPECT_NEAR(range.sensor.threshold_spread, 0.03, 1e-12);
  EXPECT_EQ(range.sensor.refractory_s, 1);
  // A threshold is that of frames, as in a sensor's document, unless told otherwise.
  EXPECT_EQ(read("{}").sensor.log_epsilon, 0.001);
  EXPECT_EQ(range.sensor.log_epsilon, kFrameLogEpsilon);
  EXPECT_EQ(read(R"({"threshold": 0.5, "log_epsilon": 0.1})").sensor.log_epsilon, 0.1);
  // Of a middle of 0.2 and a ratio of 4 the polarities' are 0.1 and 0.4.
  const GeneratorSpec ratio = read(R"({"threshold": [0.1, 0.4], "threshold_ratio": 4})");
  EXPECT_EQ(ratio.threshold, (ThresholdSpec{.range = {0.1, 0.4}, .ratio = 4}));
  EXPECT_NEAR(ratio.sensor.positive_threshold, 0.1, 1e-12);
  EXPECT_NEAR(ratio.sensor.negative_threshold, 0.4, 1e-12);
  EXPECT_NEAR(ratio.sensor.threshold_spread, 0.015, 1e-12);
}

TEST(JobManifest, HoldsNoiseAsRanges) {
  EXPECT_EQ(parse(kSoundManifest).generator.noise, std::nullopt);
  const GeneratorSpec spec = parse(testing::edited(kSoundManifest, {{"/generator/sensor", R"({
    "noise": {"shot_hz": [0.1, 1.5], "leak_hz": 0.1}})"}}))
                                 .generator;
  EXPECT_EQ(spec.noise, (NoiseSpec{.shot_hz = {0.1, 1.5}, .leak_hz = {0.1, 0.1}}));
  EXPECT_EQ(spec.duration_s, 0.1);
  EXPECT_EQ(spec.sensor, SensorSpec());
}

TEST(JobManifest, KeepsItsTextByteForByteAndStartsPathsAtItsFolder) {
  const std::string text = "// caf\xc3\xa9\r\n\t" + std::string(kSoundManifest) + "\n\n/* end */";
  const JobManifest manifest = parse(text);
  EXPECT_EQ(manifest.text, text);
  EXPECT_EQ(manifest.directory, "/data");
  EXPECT_EQ(resolve(manifest, "kitti/training"), "/data/kitti/training");
  EXPECT_EQ(resolve(manifest, "../x"), "/data/../x");
  EXPECT_EQ(resolve(manifest, "/abs"), "/abs");
  const auto here = std::filesystem::current_path();
  EXPECT_EQ(parse_job_manifest(kSoundManifest, "a", "m").directory, here / "a");
  EXPECT_EQ(parse_job_manifest(kSoundManifest, "", "m").directory, here);
}

TEST(JobManifest, SaysWhatIsWrongWithTextThatIsNoObject) {
  EXPECT_EQ(faults_of("[1]"), "d: $: expected an object, got an array of 1");
  EXPECT_THAT(faults_of(""), ::testing::StartsWith("d:1:1: expected JSON, got an error"));
  EXPECT_EQ(faults_of("\xef\xbb\xbf{}"),
            "d:1:1: expected UTF-8 without a byte order mark, got a byte order mark");
}

TEST(JobManifest, ReportsAMisspeltKeyOnce) {
  EXPECT_EQ(faults_of(testing::edited(kSoundManifest,
                                      {{"/output", ""}, {"/ouput", R"({"directory": "o"})"}})),
            "d: $.ouput: expected the key \"output\" or none, got an unknown key");
}

TEST(JobManifest, ReportsADoubleKeyBesideOtherFaults) {
  std::string text = kSoundManifest;
  text.insert(text.rfind('}'), R"(, "seed": -1, "seed": 2, "sed": 1)");
  EXPECT_EQ(faults_of(text),
            "d: $.seed: expected the key once, got it twice\n"
            "d: $.sed: expected the key \"seed\" or none, got an unknown key");
}

ImageSpec read(const char* image, DatasetKind dataset = DatasetKind::kFrames) {
  nlohmann::json source = {
      {"dataset", to_string(dataset)}, {"root", "r"}, {"pairs", {{"gaps", {1}}}}};
  if (dataset == DatasetKind::kHuman36m) source["layout"] = "fetch";
  if (dataset == DatasetKind::kMpiiList) source["annotations"] = "a";
  return parse(testing::edited(kSoundManifest, {{"/sources/0", source.dump()}, {"/image", image}}))
      .image;
}

TEST(ImageSpec, HasAPresetOfThePublishedScriptsOrKeysOneByOne) {
  using enum DatasetKind;
  using enum GreyOrder;
  const auto is = [](const ImageSpec& spec, const char* preset, GreyOrder grey, int blur) {
    return spec.preset == preset && spec.grey == grey && spec.blur == blur;
  };
  EXPECT_TRUE(is(read(R"({"preset": "kitti"})"), "kitti", kBeforeResize, 3));
  EXPECT_TRUE(is(read(R"({"preset": "mpii"})"), "mpii", kBeforeResize, 0));
  EXPECT_TRUE(is(read(R"({"preset": "demo"})"), "demo", kAfterResize, 0));
  EXPECT_TRUE(is(read(R"({"preset": "mpii"})", kKittiRaw), "mpii", kBeforeResize, 0));
  for (const DatasetKind dataset : {kKittiObject, kKittiTracking, kKittiRaw}) {
    EXPECT_TRUE(is(read("{}", dataset), "kitti", kBeforeResize, 3));
  }
  for (const DatasetKind dataset : {kMpii, kMpiiList, kHuman36m}) {
    EXPECT_TRUE(is(read("{}", dataset), "mpii", kBeforeResize, 0));
  }
  EXPECT_TRUE(is(read("{}", kFrames), "demo", kAfterResize, 0));
  // Though these are the numbers of "kitti", they name no preset.
  EXPECT_TRUE(is(read(R"({"grey": "before_resize", "blur": 3})"), "", kBeforeResize, 3));
}

TEST(ImageSpec, HasASizeAndARangeIfGiven) {
  const ImageSpec none = read(R"({"preset": "demo"})");
  EXPECT_EQ(none.size, std::nullopt);
  EXPECT_EQ(none.range, std::nullopt);
  const ImageSpec both = read(R"({"width": 861, "height": 260, "range": [7000, 9000.5]})");
  EXPECT_EQ(both.size, (ImageSize{.height = 260, .width = 861}));
  EXPECT_EQ(both.range, (ValueRange{7000, 9000.5}));
}

TEST(ManifestFields, AreNamedByTheirJsonPathAndAreWhatChangesTheBytes) {
  EXPECT_THAT(manifest_fields(R"({"a": {"b": [1, 2.5]}, "c": "x", "d": [], "e": {}})"),
              ElementsAre(Pair("$.a.b[0]", "1"), Pair("$.a.b[1]", "2.5"), Pair("$.c", "\"x\""),
                          Pair("$.d", "[]"), Pair("$.e", "{}")));
  EXPECT_THAT(manifest_fields(R"({"output": {"directory": "x", "dtype": "uint8"}, // a comment
                                  "errors": {"policy": "fail"}})"),
              ElementsAre(Pair("$.output.dtype", "\"uint8\"")));
  EXPECT_THROWS(manifest_fields("{"), std::runtime_error,
                "the manifest:1:2: expected JSON, got an error while parsing");
}

TEST(PairManifest, HasTheDefaultsOfFrames) {
  const JobManifest manifest = parse_pair_manifest("{}", "/data", "pair");
  EXPECT_EQ(manifest.image.preset, "demo");
  EXPECT_EQ(manifest.image.grey, GreyOrder::kAfterResize);
  EXPECT_EQ(manifest.image.blur, 0);
  EXPECT_EQ(manifest.image.size, std::nullopt);
  EXPECT_EQ(manifest.generator.weights, "shipped");
  EXPECT_EQ(manifest.directory, "/data");
  const JobManifest named =
      parse_pair_manifest(R"({"image": {"width": 32, "height": 16}})", "", "");
  EXPECT_EQ(named.image.preset, manifest.image.preset);
  EXPECT_EQ(named.image.grey, manifest.image.grey);
  const JobManifest by_keys =
      parse_pair_manifest(R"({"image": {"grey": "before_resize", "blur": 3}})", "", "");
  EXPECT_EQ(by_keys.image.preset, "");
}

TEST(PairManifest, TakesWhatMakesAVolumeAndNothingElse) {
  const JobManifest manifest = parse_pair_manifest(
      R"({"seed": 4, "image": {"preset": "kitti"}, "volume": {"bins": 5, "normalize": "eta98"},
          "generator": {"kind": "difference", "sensor": {"leak_rate_hz": 1}}})",
      "", "pair");
  EXPECT_EQ(manifest.seed, 4u);
  EXPECT_EQ(manifest.image.blur, 3);
  EXPECT_EQ(manifest.volume.bins, 5);
  EXPECT_EQ(manifest.generator.sensor.leak_rate_hz, 1);
  const auto pair = [](const std::string& text) { parse_pair_manifest(text, "", "pair"); };
  EXPECT_THROWS(pair(R"({"name": "x", "volume": {"bins": 0}})"), UsageError,
                "pair: $.volume.bins: expected", "pair: $.name: expected one of the keys");
  EXPECT_THROWS(pair(R"({"generator": {"kind": "events"}})"), UsageError,
                "$.generator.kind: expected a generator");
  for (const char* generator : {R"({"engine": "torch"})", R"({"device": "cuda"})"}) {
    EXPECT_THROWS(pair(R"({"generator": )" + std::string(generator) + "}"), UsageError,
                  "$.generator: expected the engine \"onednn\"");
  }
}

TEST(ManifestFile, IsReadWithItsTextAndFolderOrNamedWithItsFault) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "m.json";
  const std::string text = std::string("// a comment\r\n") + testing::kSoundManifest;
  testing::write_file(file, text);
  const JobManifest manifest = read_job_manifest(file);
  EXPECT_EQ(manifest.text, text);
  EXPECT_EQ(manifest.directory, folder.path());
  testing::write_file(file, "");
  EXPECT_THROWS(read_job_manifest(file), UsageError, file.string() + ":1:1: expected JSON");
  testing::write_file(file, "{}");
  EXPECT_THROWS(read_job_manifest(file), UsageError, file.string() + ": $.format: expected");
  EXPECT_THROWS(read_job_manifest(folder / "none.json"), InputError,
                ::testing::Eq("expected a manifest, got \"No such file or directory\", in " +
                              (folder / "none.json").string()));
  EXPECT_THROWS(read_job_manifest(folder.path()), InputError, "got \"Is a directory\"");
}

}  // namespace
}  // namespace eventgan
