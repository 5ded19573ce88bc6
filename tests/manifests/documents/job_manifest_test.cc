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

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::kSoundManifest;
using testing::ManifestCase;
using ::testing::Pair;
using ::testing::ThrowsMessage;

JobManifest parse(const std::string& text) { return parse_job_manifest(text, "/data", "m.json"); }

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
  std::string expected;
  for (const std::string& line : GetParam().faults) {
    expected += (expected.empty() ? "m.json: " : "\nm.json: ") + line;
  }
  EXPECT_EQ(faults_of(testing::manifest_text(GetParam())), expected);
}

INSTANTIATE_TEST_SUITE_P(Table, ManifestFaults, ::testing::ValuesIn(testing::manifest_cases()),
                         [](const auto& entry) { return testing::test_name(entry.param); });

TEST(JobManifest, HasTheDefaultsOfItsHeader) {
  const JobManifest manifest = parse(kSoundManifest);
  EXPECT_EQ(manifest.seed, 0u);
  ASSERT_EQ(manifest.sources.size(), 1u);
  EXPECT_EQ(manifest.sources[0].split, "train");
  EXPECT_EQ(manifest.sources[0].pairs.side, PairSide::kBefore);
  EXPECT_EQ(manifest.sources[0].pairs.choose, PairChoice::kOne);
  EXPECT_EQ(manifest.sources[0].pairs.min_pairs, 1);
  EXPECT_EQ(manifest.sources[0].pairs.max_gap_s, std::nullopt);
  EXPECT_EQ(manifest.sources[0].raw_root, std::nullopt);
  EXPECT_EQ(manifest.sources[0].layout, std::nullopt);
  EXPECT_EQ(manifest.sources[0].every, 1);
  EXPECT_EQ(manifest.sources[0].frames_per_second, std::nullopt);
  EXPECT_EQ(manifest.image.fit, ImageFit::kStretch);
  EXPECT_EQ(manifest.generator.kind, GeneratorKind::kNetwork);
  EXPECT_EQ(manifest.generator.engine, std::nullopt);
  EXPECT_EQ(manifest.generator.device, Device::kCpu);
  EXPECT_EQ(manifest.generator.precision, Precision::kFloat32);
  EXPECT_EQ(manifest.volume.bins, 9);
  EXPECT_EQ(manifest.volume.normalize, Normalization::kNone);
  EXPECT_EQ(manifest.output.samples_per_shard, std::nullopt);
  EXPECT_EQ(manifest.output.dtype, StoredType::kFloat16);
  EXPECT_EQ(manifest.output.deflate_level, 1);
  EXPECT_EQ(manifest.errors.policy, ErrorPolicy::kQuarantine);
  EXPECT_EQ(manifest.errors.max_count, 100);
  EXPECT_EQ(manifest.errors.max_fraction, 0.01);
}

TEST(JobManifest, HoldsEveryValueGiven) {
  const JobManifest manifest = parse(R"({
    "format": "eventgan-manifest", "version": 1, "name": "n", "seed": 9223372036854775807,
    "sources": [
      {"dataset": "kitti_object", "root": "a", "split": "val", "raw_root": "b", "devkit": "c",
       "pairs": {"gaps": [6, 1, 4], "side": "after", "choose": "all", "min_pairs": 5,
                 "max_gap_s": 0.4}},
      {"dataset": "mpii", "root": "d", "annotations": "e", "sequences": "f",
       "pairs": {"gaps": [4], "side": "around"}},
      {"dataset": "human36m", "root": "g", "layout": "official", "every": 5,
       "pairs": {"gaps": [2]}},
      {"dataset": "frames", "root": "h", "frames_per_second": 29.97,
       "labels": {"format": "voc", "path": "i", "edges_from": 0}, "pairs": {"gaps": [2]}}],
    "image": {"width": 861, "height": 260, "fit": "crop", "grey": "after_resize", "blur": 5,
              "range": [7000, 9000.5]},
    "generator": {"weights": "untrained:8", "engine": "onednn", "device": "cuda",
                  "precision": "int8",
                  "scope": "labels", "motion_threshold": 2.5, "motion_margin_px": 0,
                  "label_margin_px": 100, "tile_px": 32},
    "volume": {"bins": 3, "normalize": "eta98"},
    "output": {"directory": "o", "samples_per_shard": 7, "dtype": "uint8", "deflate_level": 9},
    "errors": {"policy": "fail", "max_count": 3, "max_fraction": 0.5}})");
  EXPECT_EQ(manifest.name, "n");
  EXPECT_EQ(manifest.seed, 9223372036854775807u);
  ASSERT_EQ(manifest.sources.size(), 4u);
  const SourceSpec& kitti = manifest.sources[0];
  EXPECT_EQ(kitti.dataset, DatasetKind::kKittiObject);
  EXPECT_EQ(kitti.root, "a");
  EXPECT_EQ(kitti.split, "val");
  EXPECT_EQ(kitti.raw_root, "b");
  EXPECT_EQ(kitti.devkit, "c");
  EXPECT_THAT(kitti.pairs.gaps, ::testing::ElementsAre(1, 4, 6));  // ascending
  EXPECT_EQ(kitti.pairs.side, PairSide::kAfter);
  EXPECT_EQ(kitti.pairs.choose, PairChoice::kAll);
  EXPECT_EQ(kitti.pairs.min_pairs, 5);
  EXPECT_EQ(kitti.pairs.max_gap_s, 0.4);
  EXPECT_EQ(manifest.sources[1].annotations, "e");
  EXPECT_EQ(manifest.sources[1].sequences, "f");
  EXPECT_EQ(manifest.sources[1].pairs.side, PairSide::kAround);
  EXPECT_EQ(manifest.sources[2].layout, Human36mLayout::kOfficial);
  EXPECT_EQ(manifest.sources[2].every, 5);
  EXPECT_EQ(manifest.sources[3].frames_per_second, 29.97);
  ASSERT_TRUE(manifest.sources[3].labels);
  EXPECT_EQ(manifest.sources[3].labels->format, LabelFormat::kVoc);
  EXPECT_EQ(manifest.sources[3].labels->path, "i");
  EXPECT_EQ(manifest.sources[3].labels->edges_from, 0);
  EXPECT_EQ(manifest.image.size, (ImageSize{.height = 260, .width = 861}));
  EXPECT_EQ(manifest.image.fit, ImageFit::kCrop);
  EXPECT_EQ(manifest.image.preset, "");
  EXPECT_EQ(manifest.image.grey, GreyOrder::kAfterResize);
  EXPECT_EQ(manifest.image.blur, 5);
  EXPECT_EQ(manifest.image.range, (ValueRange{7000, 9000.5}));
  EXPECT_EQ(manifest.generator.weights, "untrained:8");
  EXPECT_EQ(manifest.generator.engine, Engine::kOnednn);
  EXPECT_EQ(manifest.generator.device, Device::kCuda);
  EXPECT_EQ(manifest.generator.precision, Precision::kInt8);
  EXPECT_EQ(manifest.generator.scope.scope, Scope::kLabels);
  EXPECT_EQ(manifest.generator.scope.motion_threshold, 2.5);
  EXPECT_EQ(manifest.generator.scope.motion_margin_px, 0);
  EXPECT_EQ(manifest.generator.scope.label_margin_px, 100);
  EXPECT_EQ(manifest.generator.scope.tile_px, 32);
  EXPECT_EQ(manifest.volume.bins, 3);
  EXPECT_EQ(manifest.volume.normalize, Normalization::kEta98);
  EXPECT_EQ(manifest.output.directory, "o");
  EXPECT_EQ(manifest.output.samples_per_shard, 7);
  EXPECT_EQ(manifest.output.dtype, StoredType::kUint8);
  EXPECT_EQ(manifest.output.deflate_level, 9);
  EXPECT_EQ(manifest.errors.policy, ErrorPolicy::kFail);
  EXPECT_EQ(manifest.errors.max_count, 3);
  EXPECT_EQ(manifest.errors.max_fraction, 0.5);
}

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

TEST(JobManifest, DrawsEventsUnlessTold) {
  EXPECT_TRUE(parse(kSoundManifest).generator.sample);
  const auto rates = testing::edited(kSoundManifest, {{"/generator/sample", "false"}});
  EXPECT_FALSE(parse(rates).generator.sample);
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

TEST(JobManifest, KeepsItsTextByteForByte) {
  const std::string text = "// caf\xc3\xa9\r\n\t" + std::string(kSoundManifest) + "\n\n/* end */";
  EXPECT_EQ(parse(text).text, text);
}

TEST(JobManifest, PathsStartAtTheFolderOfTheManifest) {
  const JobManifest manifest = parse(kSoundManifest);
  EXPECT_EQ(manifest.directory, "/data");
  EXPECT_EQ(resolve(manifest, "kitti/training"), "/data/kitti/training");
  EXPECT_EQ(resolve(manifest, "../x"), "/data/../x");
  EXPECT_EQ(resolve(manifest, "/abs"), "/abs");
}

TEST(JobManifest, MakesItsFolderAbsolute) {
  const auto here = std::filesystem::current_path();
  EXPECT_EQ(parse_job_manifest(kSoundManifest, "a", "m").directory, here / "a");
  EXPECT_EQ(parse_job_manifest(kSoundManifest, "", "m").directory, here);
}

TEST(JobManifest, SaysWhatIsWrongWithTextThatIsNoObject) {
  EXPECT_EQ(faults_of("[1]"), "m.json: $: expected an object, got an array of 1");
  EXPECT_THAT(faults_of(""), ::testing::StartsWith("m.json:1:1: expected JSON, got an error"));
  EXPECT_EQ(faults_of("\xef\xbb\xbf{}"),
            "m.json:1:1: expected UTF-8 without a byte order mark, got a byte order mark");
}

TEST(JobManifest, ReportsAMisspeltKeyOnce) {
  EXPECT_EQ(faults_of(testing::edited(kSoundManifest,
                                      {{"/output", ""}, {"/ouput", R"({"directory": "o"})"}})),
            "m.json: $.ouput: expected the key \"output\" or none, got an unknown key");
}

TEST(JobManifest, ReportsADoubleKeyBesideOtherFaults) {
  std::string text = kSoundManifest;
  text.insert(text.rfind('}'), R"(, "seed": -1, "seed": 2, "sed": 1)");
  EXPECT_EQ(faults_of(text),
            "m.json: $.seed: expected the key once, got it twice\n"
            "m.json: $.sed: expected the key \"seed\" or none, got an unknown key");
}

ImageSpec read(const char* image, DatasetKind dataset = DatasetKind::kFrames) {
  nlohmann::json source = {
      {"dataset", to_string(dataset)}, {"root", "r"}, {"pairs", {{"gaps", {1}}}}};
  if (dataset == DatasetKind::kHuman36m) source["layout"] = "fetch";
  if (dataset == DatasetKind::kMpiiList) source["annotations"] = "a";
  return parse(testing::edited(kSoundManifest, {{"/sources/0", source.dump()}, {"/image", image}}))
      .image;
}

TEST(ImageSpec, PresetsAreThoseOfThePublishedScripts) {
  const auto read_preset = [](const char* text) {
    const ImageSpec spec = read(text);
    return std::tuple(spec.preset, spec.grey, spec.blur);
  };
  EXPECT_EQ(read_preset(R"({"preset": "kitti"})"),
            std::tuple("kitti", GreyOrder::kBeforeResize, 3));
  EXPECT_EQ(read_preset(R"({"preset": "mpii"})"), std::tuple("mpii", GreyOrder::kBeforeResize, 0));
  EXPECT_EQ(read_preset(R"({"preset": "demo"})"), std::tuple("demo", GreyOrder::kAfterResize, 0));
}

TEST(ImageSpec, EachDatasetHasAPresetOfItsOwn) {
  using enum DatasetKind;
  for (const DatasetKind dataset : {kKittiObject, kKittiTracking, kKittiRaw}) {
    EXPECT_EQ(read("{}", dataset).preset, "kitti");
    EXPECT_EQ(read("{}", dataset).blur, 3);
  }
  for (const DatasetKind dataset : {kMpii, kMpiiList, kHuman36m}) {
    EXPECT_EQ(read("{}", dataset).preset, "mpii");
  }
  EXPECT_EQ(read("{}", kFrames).preset, "demo");
  EXPECT_EQ(read("{}", kFrames).grey, GreyOrder::kAfterResize);
  EXPECT_EQ(read(R"({"preset": "mpii"})", kKittiRaw).blur, 0);
}

TEST(ImageSpec, KeysGivenOneByOneNameNoPreset) {
  const ImageSpec spec = read(R"({"grey": "before_resize", "blur": 3})");
  EXPECT_EQ(spec.preset, "");  // though these are the numbers of "kitti"
  EXPECT_EQ(spec.grey, GreyOrder::kBeforeResize);
  EXPECT_EQ(spec.blur, 3);
}

TEST(ImageSpec, WithoutSizeEveryImageKeepsItsOwn) {
  EXPECT_EQ(read(R"({"preset": "demo"})").size, std::nullopt);
}

TEST(ManifestFields, AreNamedByTheirJsonPath) {
  EXPECT_THAT(manifest_fields(R"({"a": {"b": [1, 2.5]}, "c": "x", "d": [], "e": {}})"),
              ElementsAre(Pair("$.a.b[0]", "1"), Pair("$.a.b[1]", "2.5"), Pair("$.c", "\"x\""),
                          Pair("$.d", "[]"), Pair("$.e", "{}")));
}

TEST(ManifestFields, LeaveOutWhatDoesNotChangeTheBytes) {
  const auto fields =
      manifest_fields(R"({"output": {"directory": "x", "dtype": "uint8"}, // a comment
                                          "errors": {"policy": "fail"}})");
  EXPECT_THAT(fields, ElementsAre(Pair("$.output.dtype", "\"uint8\"")));
}

TEST(ManifestFields, OfNoJsonIsAnError) { EXPECT_THROW(manifest_fields("{"), std::runtime_error); }

TEST(ManifestFile, IsReadWithItsTextAndFolder) {
  const testing::TemporaryFolder folder;
  const std::string text = std::string("// a comment\r\n") + testing::kSoundManifest;
  testing::write_file(folder / "m.json", text);
  const JobManifest manifest = read_job_manifest(folder / "m.json");
  EXPECT_EQ(manifest.text, text);
  EXPECT_EQ(manifest.directory, folder.path());
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
  const auto faults_of_pair = [](const std::string& text) {
    return [text] { parse_pair_manifest(text, "", "pair"); };
  };
  EXPECT_THAT(
      faults_of_pair(R"({"name": "x", "volume": {"bins": 0}})"),
      ThrowsMessage<UsageError>(AllOf(HasSubstr("pair: $.volume.bins: expected"),
                                      HasSubstr("pair: $.name: expected one of the keys"))));
  EXPECT_THAT(faults_of_pair(R"({"generator": {"kind": "events"}})"),
              ThrowsMessage<UsageError>(HasSubstr("$.generator.kind: expected a generator")));
  for (const char* generator : {R"({"engine": "torch"})", R"({"device": "cuda"})"}) {
    EXPECT_THAT(
        faults_of_pair(R"({"generator": )" + std::string(generator) + "}"),
        ThrowsMessage<UsageError>(HasSubstr("$.generator: expected the engine \"onednn\"")));
  }
}

TEST(ManifestFile, ThatCannotBeReadIsMissingInput) {
  const testing::TemporaryFolder folder;
  EXPECT_THAT(
      [&] { read_job_manifest(folder / "none.json"); },
      ThrowsMessage<InputError>("expected a manifest, got \"No such file or directory\", in " +
                                (folder / "none.json").string()));
  EXPECT_THAT([&] { read_job_manifest(folder.path()); },
              ThrowsMessage<InputError>(HasSubstr("got \"Is a directory\"")));
}

TEST(ManifestFile, FaultsNameTheFile) {
  const testing::TemporaryFolder folder;
  const auto file = folder / "m.json";
  testing::write_file(file, "");
  EXPECT_THAT([&] { read_job_manifest(file); },
              ThrowsMessage<UsageError>(HasSubstr(file.string() + ":1:1: expected JSON")));
  testing::write_file(file, "{}");
  EXPECT_THAT([&] { read_job_manifest(file); },
              ThrowsMessage<UsageError>(HasSubstr(file.string() + ": $.format: expected")));
}

}  // namespace
}  // namespace eventgan
