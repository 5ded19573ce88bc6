#include "manifests/documents/training_manifest.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "manifests/values/faults.h"
#include "tests/manifests/documents/json_schema.h"
#include "tests/manifests/documents/manifest_cases.h"

namespace eventgan {
namespace {

using testing::ManifestCase;

constexpr char kSoundTraining[] = R"({
  "format": "eventgan-training", "version": 1, "name": "t",
  "recordings": [{"path": "a.hdf5", "format": "mvsec"}],
  "steps": {"flow": 1, "reconstruction": 1, "generator": 3},
  "output": {"directory": "out"}
})";

TrainingManifest parse_training(const std::string& text) {
  return parse_training_manifest(text, "/data", "d");
}

const ManifestCase kTrainingCases[] = {
    {"as it is", {}, {}},
    {"another format",
     {{"/format", R"("eventgan-manifest")"}},
     {R"($.format: expected "eventgan-training", got "eventgan-manifest")"}},
    {"nothing that is required",
     {{"/name", ""}, {"/recordings", ""}, {"/steps", ""}, {"/output", ""}},
     {"$.name: " + testing::kNameRule + "nothing",
      "$.recordings: expected an array of 1 or more, got nothing",
      "$.steps: expected an object, got nothing", "$.output: expected an object, got nothing",
      "$.steps: expected at least one phase with more than 0 steps, got none"}},
    {"a recording of no kind",
     {{"/recordings/0", R"({"path": "", "format": "mcap", "weight": 0, "first_frame": -1,
                            "last_frame": 0, "wieght": 1})"}},
     {R"($.recordings[0].path: expected a path, got "")",
      R"($.recordings[0].format: expected "mvsec", "eventgan", "ecd", "aedat4", "aedat3", "rosbag", "dsec", )"
      R"("event_utils" or "v2e", got "mcap")",
      "$.recordings[0].weight: expected a number 1e-06..1e+06, got 0",
      "$.recordings[0].first_frame: expected an integer 0..1000000000, got -1",
      "$.recordings[0].last_frame: expected an integer 1..1000000000, got 0",
      R"($.recordings[0].wieght: expected the key "weight" or none, got an unknown key)"}},
    {"a camera", {{"/recordings/0/camera", R"("right")"}}, {}},
    {"a camera of no kind",
     {{"/recordings/0/camera", R"("top")"}},
     {R"($.recordings[0].camera: expected "left" or "right", got "top")"}},
    {"a camera of a format without",
     {{"/recordings/0/camera", R"("left")"}, {"/recordings/0/format", R"("ecd")"}},
     {R"($.recordings[0].camera: expected no such key for format "ecd" (only for mvsec, dsec), got "left")"}},
    {"a camera of DSEC's two",
     {{"/recordings/0/camera", R"("right")"}, {"/recordings/0/format", R"("dsec")"}},
     {}},
    {"rectified", {{"/recordings/0/rectify", "true"}, {"/recordings/0/format", R"("dsec")"}}, {}},
    {"a recording without frames",
     {{"/recordings/0/format", R"("m3ed")"}},
     {R"($.recordings[0].format: expected "mvsec", "eventgan", "ecd", "aedat4", "aedat3", "rosbag", "dsec", )"
      R"("event_utils" or "v2e", got "m3ed")"}},
    {"rectified without a map",
     {{"/recordings/0/rectify", "true"}},
     {R"($.recordings[0].rectify: expected no such key for format "mvsec" (only for dsec), got true)"}},
    {"a recording of one frame",
     {{"/recordings/0/first_frame", "5"}, {"/recordings/0/last_frame", "5"}},
     {"$.recordings[0].last_frame: expected a frame after first_frame (5), got 5"},
     true},
    {"no validation", {{"/validation", "[]"}}, {}},
    {"gaps of no kind",
     {{"/gaps", "[0, 2, 2, 7]"}},
     {"$.gaps[0]: expected an integer 1..6, got 0", "$.gaps[2]: expected each gap once, got 2",
      "$.gaps[3]: expected an integer 1..6, got 7"}},
    {"a crop too small for the discriminator",
     {{"/crop", R"({"width": 48, "height": 47})"}},
     {"$.crop.height: expected an integer 48..2048, got 47"},
     true},
    {"a small crop without discriminator",
     {{"/crop", R"({"width": 16, "height": 16})"}, {"/losses", R"({"adversarial": 0})"}},
     {}},
    {"a crop too small for the generator",
     {{"/crop", R"({"width": 15, "height": 16})"}, {"/losses", R"({"adversarial": 0})"}},
     {"$.crop.width: expected an integer 16..2048, got 15"}},
    {"an odd batch",
     {{"/batch", "3"}},
     {"$.batch: expected an even batch, since losses.adversarial > 0, got 3"},
     true},
    {"an odd batch without discriminator",
     {{"/batch", "1"}, {"/losses", R"({"adversarial": 0})"}},
     {}},
    {"no batch", {{"/batch", "0"}}, {"$.batch: expected an integer 1..512, got 0"}},
    {"losses below 0",
     {{"/losses", R"({"adversarial": -1, "smoothness": -0.5})"}},
     {"$.losses.adversarial: expected a number 0..1e+06, got -1",
      "$.losses.smoothness: expected a number 0..1e+06, got -0.5"}},
    {"no losses",
     {{"/losses", R"({"adversarial": 0, "flow": 0, "reconstruction": 0, "smoothness": 1})"}},
     {"$.losses: expected one of adversarial, flow, reconstruction, volume, count, overlap above "
      "0, "
      "got all 0"},
     true},
    {"a volume loss alone",
     {{"/losses", R"({"adversarial": 0, "flow": 0, "reconstruction": 0, "volume": 1})"},
      {"/steps", R"({"generator": 1})"}},
     {}},
    {"a flow loss without its network",
     {{"/steps/flow", ""}, {"/steps/reconstruction", "0"}},
     {"$.steps: expected steps.flow > 0 while losses.flow > 0, got 0 steps",
      "$.steps: expected steps.reconstruction > 0 while losses.reconstruction > 0, got 0 steps"},
     true},
    {"a flow network alone", {{"/steps", R"({"flow": 5})"}}, {}},
    {"no steps",
     {{"/steps", "{}"}},
     {"$.steps: expected at least one phase with more than 0 steps, got none"},
     true},
    {"networks of no kind",
     {{"/network", R"({"generator_channels": 0, "discriminator_channels": 129,
                       "cycle_channels": 65, "spectral_norm": "all", "bins": 0})"}},
     {"$.network.generator_channels: expected an integer 1..64, got 0",
      "$.network.discriminator_channels: expected an integer 1..128, got 129",
      "$.network.cycle_channels: expected an integer 1..64, got 65",
      R"($.network.spectral_norm: expected "decoders", "encoders" or "none", got "all")",
      "$.network.bins: expected an integer 1..64, got 0"}},
    {"an augmentation of no kind",
     {{"/augmentation", R"({"flip": 1, "gain": [1], "gamma": [0, 1, 2], "static_fraction": 2})"}},
     {"$.augmentation.flip: expected true or false, got 1",
      "$.augmentation.gain: expected an array of 2 or more, got an array of 1",
      "$.augmentation.gamma: expected an array of 2, got an array of 3",
      "$.augmentation.static_fraction: expected a number 0..1, got 2"}},
    {"a range the wrong way round",
     {{"/augmentation", R"({"gain": [1.2, 0.8]})"}},
     {"$.augmentation.gain[1]: expected a number not below the previous one, got 0.8"},
     true},
    {"an optimizer of no kind",
     {{"/optimizer", R"({"generator_rate": 0, "betas": [0, 1], "final_rate_fraction": -1})"}},
     {"$.optimizer.generator_rate: expected a number 1e-09..1, got 0",
      "$.optimizer.betas[1]: expected a number 0..0.999999, got 1",
      "$.optimizer.final_rate_fraction: expected a number 0..1, got -1"}},
    {"other settings out of range",
     {{"/label_flip", "1.5"}, {"/discriminator_steps", "0"}, {"/precision", R"("float16")"}},
     {"$.label_flip: expected a number 0..1, got 1.5",
      "$.discriminator_steps: expected an integer 1..10, got 0",
      R"($.precision: expected "float32" or "bfloat16", got "float16")"}},
    {"output of no kind",
     {{"/output", R"({"checkpoint_minutes": -1, "image_minutes": "1"})"}},
     {"$.output.directory: expected a path, got nothing",
      "$.output.checkpoint_minutes: expected a number 0..1e+06, got -1",
      R"($.output.image_minutes: expected a number 0..1e+06, got "1")"}},
};

/// What makes the sound training that of a network that knows its sensor.
const std::vector<testing::Edit> kWithSensor = {
    {"/network", R"({"sensor": true})"},
    {"/recordings/0/threshold", "0.25"},
    {"/losses", R"({"adversarial": 0, "flow": 0, "reconstruction": 0, "likelihood": 1})"}};

ManifestCase with_sensor(std::string name, std::vector<testing::Edit> edits,
                         std::vector<std::string> faults = {}) {
  std::vector<testing::Edit> all = kWithSensor;
  all.insert(all.end(), edits.begin(), edits.end());
  return {std::move(name), std::move(all), std::move(faults)};
}

const std::string kLossesOfASensor =
    "expected likelihood above 0 and adversarial, flow, reconstruction 0, since network.sensor, "
    "got others";

const ManifestCase kSensorTrainingCases[] = {
    with_sensor("a network that knows its sensor", {}),
    with_sensor("thresholds of the polarities", {{"/recordings/0/threshold_ratio", "0.2"},
                                                 {"/validation", R"([{"path": "b", "format": "ecd",
                                                    "threshold": 5, "threshold_ratio": 5}])"}}),
    with_sensor("simulated samples",
                {{"/simulated", R"({"textures": ["a", "b"], "fraction": 1})"}}),
    with_sensor("simulated samples by default", {{"/simulated", R"({"textures": ["a"]})"}}),
    with_sensor("simulated samples of no kind",
                {{"/simulated", R"({"textures": [], "fraction": 1.5, "planes": 3})"}},
                {"$.simulated.textures: expected an array of 1 or more, got an array of 0",
                 "$.simulated.fraction: expected a number 0..1, got 1.5",
                 "$.simulated.planes: expected one of the keys textures, fraction, got an unknown "
                 "key"}),
    with_sensor("simulated samples of nothing", {{"/simulated", R"({"textures": [""]})"}},
                {R"($.simulated.textures[0]: expected a path, got "")"}),
    with_sensor("simulated samples without textures", {{"/simulated", "{}"}},
                {"$.simulated.textures: expected an array of 1 or more, got nothing"}),
    with_sensor("a teacher", {{"/teacher", R"("wide.safetensors")"}}),
    with_sensor("a teacher of no kind", {{"/teacher", "16"}},
                {"$.teacher: expected a path, got 16"}),
    with_sensor("thresholds out of range",
                {{"/recordings/0/threshold", "0.009"}, {"/recordings/0/threshold_ratio", "5.1"}},
                {"$.recordings[0].threshold: expected a number 0.01..5, got 0.009",
                 "$.recordings[0].threshold_ratio: expected a number 0.2..5, got 5.1"}),
    with_sensor("a ratio without threshold",
                {{"/recordings/0/threshold", ""}, {"/recordings/0/threshold_ratio", "1"}},
                {"$.recordings[0].threshold_ratio: expected threshold beside it, got none",
                 "$.recordings: expected a threshold of each recording, since network.sensor, got "
                 "none of a.hdf5"}),
    with_sensor("a recording without threshold",
                {{"/recordings/1", R"({"path": "b", "format": "ecd"})"}},
                {"$.recordings: expected a threshold of each recording, since network.sensor, got "
                 "none of b"}),
    with_sensor("a validation without threshold",
                {{"/validation", R"([{"path": "c", "format": "ecd"}])"}},
                {"$.validation: expected a threshold of each recording, since network.sensor, got "
                 "none of c"}),
    with_sensor("direct losses beside likelihood",
                {{"/losses/volume", "1"}, {"/losses/count", "2"}, {"/losses/overlap", "1e-3"}}),
    with_sensor("the likelihood of blocks beside it", {{"/losses/block_likelihood", "0.25"}}),
    with_sensor("the likelihood of blocks in place of it",
                {{"/losses/likelihood", "0"}, {"/losses/block_likelihood", "0.25"}},
                {"$.losses: " + kLossesOfASensor}),
    with_sensor("no likelihood", {{"/losses/likelihood", "0"}}, {"$.losses: " + kLossesOfASensor}),
    with_sensor("direct losses in place of likelihood",
                {{"/losses/likelihood", "0"}, {"/losses/volume", "1"}},
                {"$.losses: " + kLossesOfASensor}),
    with_sensor("the published losses beside likelihood", {{"/losses", R"({"likelihood": 1})"}},
                {"$.losses: " + kLossesOfASensor}),
    with_sensor("no losses of a network that knows its sensor", {{"/losses", ""}},
                {"$.steps: " + kLossesOfASensor}),
    {"a sensor of no kind",
     {{"/network", R"({"sensor": 1})"}},
     {"$.network.sensor: expected true or false, got 1"}},
    {"a threshold that nobody learns",
     {{"/recordings/0/threshold", "0.25"}, {"/network", R"({"sensor": false})"}},
     {"$.recordings: expected no threshold, unless network.sensor, got that of a.hdf5"}},
    {"a validations threshold that nobody learns",
     {{"/validation", R"([{"path": "c", "format": "ecd", "threshold": 0.25}])"}},
     {"$.validation: expected no threshold, unless network.sensor, got that of c"}},
    {"simulated samples that nobody needs",
     {{"/simulated", R"({"textures": ["a"]})"}},
     {"$.simulated: expected network.sensor with it, got none"}},
    {"a teacher of normalised volumes",
     {{"/teacher", R"("wide.safetensors")"}},
     {"$.teacher: expected network.sensor with it, got none"}},
    {"a likelihood of normalised volumes",
     {{"/losses", R"({"likelihood": 1})"}},
     {"$.losses: expected likelihood and block_likelihood 0, unless network.sensor, got others"}},
    {"a likelihood of blocks of normalised volumes",
     {{"/losses", R"({"block_likelihood": 1})"}},
     {"$.losses: expected likelihood and block_likelihood 0, unless network.sensor, got others"}},
};

class TrainingFaults : public ::testing::TestWithParam<ManifestCase> {};

TEST_P(TrainingFaults, AreAllReportedAndSeenByTheSchema) {
  testing::expect_faults(GetParam(), kSoundTraining, "training.schema.json", parse_training);
}

INSTANTIATE_TEST_SUITE_P(Table, TrainingFaults, ::testing::ValuesIn(kTrainingCases),
                         [](const auto& entry) { return testing::test_name(entry.param); });
INSTANTIATE_TEST_SUITE_P(Sensors, TrainingFaults, ::testing::ValuesIn(kSensorTrainingCases),
                         [](const auto& entry) { return testing::test_name(entry.param); });

TEST(TrainingManifest, HoldsWhatANetworkThatKnowsItsSensorNeeds) {
  const TrainingManifest plain = parse_training(kSoundTraining);
  EXPECT_FALSE(plain.network.sensor);
  EXPECT_EQ(plain.losses.likelihood, 0);
  EXPECT_FALSE(plain.simulated.has_value());
  EXPECT_EQ(plain.recordings.at(0).threshold, std::nullopt);

  std::vector<testing::Edit> edits = kWithSensor;
  edits.push_back({"/recordings/1", R"({"path": "b", "format": "ecd", "threshold": 0.4,
                                        "threshold_ratio": 1.5})"});
  edits.push_back({"/simulated", R"({"textures": ["t/a", "b"], "fraction": 0.75})"});
  const TrainingManifest manifest = parse_training(testing::edited(kSoundTraining, edits));
  EXPECT_TRUE(manifest.network.sensor);
  EXPECT_EQ(manifest.losses.likelihood, 1);
  EXPECT_EQ(manifest.recordings.at(0).threshold, ContrastThreshold{0.25});
  EXPECT_EQ(manifest.recordings.at(1).threshold, (ContrastThreshold{0.4, 1.5}));
  ASSERT_TRUE(manifest.simulated.has_value());
  EXPECT_THAT(manifest.simulated->textures, ::testing::ElementsAre("t/a", "b"));
  EXPECT_EQ(manifest.simulated->fraction, 0.75);
}

}  // namespace
}  // namespace eventgan
