#include "manifests/documents/sensor_document.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "manifests/documents/detail/sensor_document.h"
#include "manifests/documents/job_manifest.h"
#include "manifests/documents/manifest_fields.h"
#include "manifests/values/faults.h"
#include "manifests/values/job.h"
#include "manifests/values/pair_key.h"
#include "tests/manifests/documents/json_schema.h"
#include "tests/manifests/documents/manifest_cases.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::edited;
using testing::kSoundManifest;
using testing::ManifestCase;

constexpr char kSensorSchema[] = "sensor.schema.json";

constexpr char kSoundSensor[] = R"({
  "format": "eventgan-sensor", "version": 1, "name": "mine",
  "threshold": [0.2, 0.4], "threshold_ratio": 1.1,
  "network": {"weights": "abc", "threshold": 0.3, "threshold_ratio": 1.2},
  "noise": {"shot_hz": [0.5, 1], "leak_hz": 0.25, "hot_pixels": 1e-4},
  "origin": "by eye"
})";

const ManifestCase kSensorCases[] = {
    {"as it is", {}, {}},
    {"nothing but a name",
     {{"/threshold", ""},
      {"/threshold_ratio", ""},
      {"/network", ""},
      {"/noise", ""},
      {"/origin", ""}},
     {}},
    {"another format",
     {{"/format", R"("eventgan-manifest")"}},
     {R"($.format: expected "eventgan-sensor", got "eventgan-manifest")"}},
    {"another version",
     {{"/version", "2"}},
     {"$.version: expected 1 (the version that this program reads), got 2"}},
    {"no name", {{"/name", ""}}, {"$.name: " + testing::kNameRule + "nothing"}},
    {"a ratio of no threshold",
     {{"/threshold", ""}},
     {"$.threshold_ratio: expected threshold beside it, got none"}},
    {"a network's threshold of no weights, and none",
     {{"/network", R"({"threshold_ratio": 1})"}},
     {"$.network.weights: expected text, got nothing",
      "$.network.threshold_ratio: expected threshold beside it, got none",
      "$.network.threshold: expected a number or [least, most], got nothing"}},
    {"numbers out of range",
     {{"/threshold", "5.1"}, {"/threshold_ratio", "0.1"}, {"/noise/shot_hz", "-1"}},
     {"$.threshold: expected a number 0.01..5, got 5.1",
      "$.threshold_ratio: expected a number 0.2..5, got 0.1",
      "$.noise.shot_hz: expected a number 0..1000, got -1"}},
    {"a range from more to less",
     {{"/threshold", "[0.4, 0.2]"}},
     {"$.threshold[1]: expected a number not below the previous one, got 0.2"},
     true},
    {"an origin that is no text", {{"/origin", "1"}}, {"$.origin: expected text, got 1"}},
    {"a mistyped key",
     {{"/orign", R"("")"}},
     {R"($.orign: expected the key "origin" or none, got an unknown key)"}},
};

class SensorFaults : public ::testing::TestWithParam<ManifestCase> {};

TEST_P(SensorFaults, AreAllReportedAndSeenByTheSchema) {
  testing::expect_faults(GetParam(), kSoundSensor, kSensorSchema,
                         [](const std::string& text) { parse_camera_sensor(text, "d"); });
}

INSTANTIATE_TEST_SUITE_P(Table, SensorFaults, ::testing::ValuesIn(kSensorCases),
                         [](const auto& entry) { return testing::test_name(entry.param); });

CameraSensor sound_sensor() {
  CameraSensor sensor;
  sensor.name = "mine";
  sensor.threshold = ThresholdSpec{{0.2, 0.4}, 1.1};
  sensor.network = NetworkThreshold{"abc", ThresholdSpec{{0.3, 0.3}, 1.2}};
  sensor.noise = NoiseSpec{{0.5, 1}, {0.25, 0.25}, {1e-4, 1e-4}};
  sensor.origin = "by eye";
  return sensor;
}

TEST(SensorDocument, HoldsEveryValueGivenAndIsReadAsItWasWritten) {
  EXPECT_EQ(parse_camera_sensor(kSoundSensor, "s"), sound_sensor());
  EXPECT_EQ(parse_camera_sensor(to_document(sound_sensor()), "s"), sound_sensor());
  CameraSensor bare;
  bare.name = "bare";
  EXPECT_EQ(parse_camera_sensor(to_document(bare), "s"), bare);
  EXPECT_TRUE(testing::schema_accepts(kSensorSchema, nlohmann::json::parse(to_document(bare))));
}

TEST(ShippedSensors, AreThoseOfTheRepositoryAndOfTheSchema) {
  const std::filesystem::path folder =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "manifests" / "sensors";
  std::size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    ++files;
    const std::string name = entry.path().stem();
    const CameraSensor sensor = open_camera_sensor(name);
    EXPECT_EQ(sensor, open_camera_sensor(entry.path())) << name;
    EXPECT_EQ(sensor.name, name);
    EXPECT_TRUE(sensor.threshold && sensor.network && sensor.noise) << name;
    EXPECT_NE(sensor.origin, "") << name;
    const nlohmann::json manifest =
        nlohmann::json::parse(edited(kSoundManifest, {{"/generator/sensor", '"' + name + '"'}}));
    EXPECT_TRUE(testing::schema_accepts("manifest.schema.json", manifest)) << name;
  }
  EXPECT_EQ(shipped_sensors().size(), files);
}

TEST(OpenCameraSensor, SaysWhatThereIs) {
  EXPECT_THROWS(open_camera_sensor("davis"), UsageError,
                ::testing::Eq("expected davis346, prophesee_gen4 or the path of a "
                              "sensor's document (*.json), got davis"));
  EXPECT_THROWS(open_camera_sensor("/none/s.json"), InputError,
                ::testing::Eq("expected a sensor's document, got \"No such file or "
                              "directory\", in /none/s.json"));
}

class SensorOfAManifest : public ::testing::Test {
 protected:
  SensorOfAManifest() { testing::write_file(folder_ / "mine.json", kSoundSensor); }

  JobManifest read(const std::string& sensor, std::vector<testing::Edit> edits = {}) {
    edits.push_back({"/generator/sensor", '"' + sensor + '"'});
    testing::write_file(folder_ / "m.json", edited(kSoundManifest, edits));
    return read_job_manifest(folder_ / "m.json");
  }

  testing::TemporaryFolder folder_;
};

TEST_F(SensorOfAManifest, IsThatOfTheDocument) {
  GeneratorSpec spec = read("mine.json").generator;
  EXPECT_EQ(spec.camera, "mine");
  EXPECT_EQ(spec.threshold, sound_sensor().network->threshold);
  EXPECT_EQ(spec.threshold_weights, "abc");
  EXPECT_EQ(spec.noise, sound_sensor().noise);
  spec = read("mine.json", {{"/generator/kind", R"("difference")"}, {"/generator/weights", ""}})
             .generator;
  EXPECT_EQ(spec.threshold, sound_sensor().threshold);
  EXPECT_EQ(spec.threshold_weights, "");
  // Of a simulator: the middle of the range by polarity, of the frames' log intensity.
  EXPECT_EQ(spec.sensor.log_epsilon, kFrameLogEpsilon);
  EXPECT_NEAR(spec.sensor.negative_threshold / spec.sensor.positive_threshold, 1.1, 1e-9);
  EXPECT_NEAR(spec.sensor.negative_threshold * spec.sensor.positive_threshold, 0.08, 1e-9);
}

TEST_F(SensorOfAManifest, OfAModelAloneIsNoneForANetwork) {
  testing::write_file(folder_ / "model.json", edited(kSoundSensor, {{"/network", ""}}));
  EXPECT_THROWS(read("model.json"), UsageError,
                "$.generator.sensor: expected a \"network\" in the sensor's document, which "
                "`eventgan fit --weights` finds, got a threshold of difference and esim alone");
  testing::write_file(
      folder_ / "noise.json",
      edited(kSoundSensor, {{"/network", ""}, {"/threshold", ""}, {"/threshold_ratio", ""}}));
  EXPECT_EQ(read("noise.json").generator.threshold, std::nullopt);
}

TEST_F(SensorOfAManifest, StaysInTheTextWithoutTheFile) {
  const JobManifest manifest = read("mine.json");
  std::filesystem::remove(folder_ / "mine.json");
  const JobManifest later = parse_job_manifest(manifest.text, "/elsewhere", "plan.json");
  EXPECT_EQ(later.text, manifest.text);
  EXPECT_EQ(later.generator.threshold, manifest.generator.threshold);
  EXPECT_EQ(later.generator.camera, "mine");
  const auto fields = manifest_fields(manifest.text);
  EXPECT_EQ(fields.at("$.generator.sensor.name"), R"("mine")");
  EXPECT_EQ(fields.at("$.generator.sensor.threshold[1]"), "0.4");
  EXPECT_EQ(fields.at("$.generator.sensor.origin"), R"("by eye")");
}

TEST_F(SensorOfAManifest, IsFoundByAShippedNameOrHasFaultsOfItsOwnFile) {
  const GeneratorSpec spec = read("davis346").generator;
  EXPECT_EQ(spec.camera, "davis346");
  EXPECT_EQ(spec.threshold, open_camera_sensor("davis346").network->threshold);
  constexpr char kPair[] = R"({"generator": {"kind": "esim", "sensor": "davis346"}})";
  EXPECT_EQ(parse_pair_manifest(kPair, "", "pair").generator.camera, "davis346");
  testing::write_file(folder_ / "bad.json", edited(kSoundSensor, {{"/threshold", "0"}}));
  const std::string file = (folder_ / "bad.json").string();
  EXPECT_THROWS(read("bad.json"), UsageError,
                ::testing::Eq(file + ": $.threshold: expected a number 0.01..5, got 0"));
  EXPECT_THROWS(read("none.json"), InputError, "expected a sensor's document, got \"No such");
}

TEST(WithSensorDocument, LeavesOtherTextsAsTheyAre) {
  for (const char* text :
       {"", "[]", "{", R"({"generator": 1})", R"({"generator": {"sensor": {"noise": {}}}} // a)",
        R"({"generator": {"sensor": "davis"}})",
        R"({"generator": {"sensor": "davis346"}, "generator": {}})"}) {
    EXPECT_EQ(with_sensor_document(text, "/"), text);
  }
}

}  // namespace
}  // namespace eventgan
