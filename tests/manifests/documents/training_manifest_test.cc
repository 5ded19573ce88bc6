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

constexpr char kTrainingSchema[] = "training.schema.json";

constexpr char kSoundTraining[] = R"({
  "format": "eventgan-training", "version": 1, "name": "t",
  "recordings": [{"path": "a.hdf5", "format": "mvsec"}],
  "steps": {"flow": 1, "reconstruction": 1, "generator": 3},
  "output": {"directory": "out"}
})";

TrainingManifest parse_training(const std::string& text) {
  return parse_training_manifest(text, "/data", "t.json");
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
     {{"/recordings/0", R"({"path": "", "format": "rosbag", "weight": 0, "first_frame": -1,
                            "last_frame": 0, "wieght": 1})"}},
     {R"($.recordings[0].path: expected a path, got "")",
      R"($.recordings[0].format: expected "mvsec", "eventgan", "ecd", "aedat4", "dsec", "event_utils" or )"
      R"("v2e", got "rosbag")",
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
     {R"($.recordings[0].format: expected "mvsec", "eventgan", "ecd", "aedat4", "dsec", "event_utils" or )"
      R"("v2e", got "m3ed")"}},
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
  const std::string text = testing::edited(kSoundTraining, GetParam().edits);
  std::string expected, got;
  for (const std::string& line : GetParam().faults) {
    expected += (expected.empty() ? "t.json: " : "\nt.json: ") + line;
  }
  try {
    parse_training(text);
  } catch (const UsageError& error) {
    got = error.what();
  }
  EXPECT_EQ(got, expected);
  EXPECT_EQ(testing::schema_accepts(kTrainingSchema, nlohmann::json::parse(text)),
            GetParam().faults.empty() || GetParam().beyond_schema);
}

INSTANTIATE_TEST_SUITE_P(Table, TrainingFaults, ::testing::ValuesIn(kTrainingCases),
                         [](const auto& entry) { return testing::test_name(entry.param); });
INSTANTIATE_TEST_SUITE_P(Sensors, TrainingFaults, ::testing::ValuesIn(kSensorTrainingCases),
                         [](const auto& entry) { return testing::test_name(entry.param); });

TEST(TrainingManifest, HoldsEveryValueGiven) {
  const TrainingManifest manifest = parse_training(R"({
    "format": "eventgan-training", "version": 1, "name": "n", "seed": 9,
    "recordings": [{"path": "a", "format": "mvsec", "camera": "right", "weight": 2.5,
                    "first_frame": 3, "last_frame": 8}, {"path": "b", "format": "ecd"}],
    "validation": [{"path": "c", "format": "eventgan"}],
    "gaps": [3, 1], "crop": {"width": 96, "height": 64}, "batch": 4,
    "network": {"generator_channels": 8, "discriminator_channels": 16, "cycle_channels": 4,
                "spectral_norm": "encoders", "output_slope": 0.25, "difference_gain": 6, "bins": 5},
    "losses": {"adversarial": 0.5, "flow": 2, "reconstruction": 3, "volume": 4, "count": 6, "overlap": 7,
               "quantile": 0.7, "smoothness": 5},
    "label_flip": 0.2, "discriminator_steps": 3,
    "augmentation": {"flip": false, "gain": [0.5, 2], "gamma": [0.8, 1.25],
                     "reverse": true, "static_fraction": 0.1, "event_fraction": 0.3},
    "optimizer": {"generator_rate": 1e-3, "cycle_rate": 2e-3, "discriminator_rate": 3e-3,
                  "betas": [0.5, 0.9], "final_rate_fraction": 0.01},
    "precision": "bfloat16", "steps": {"flow": 1, "reconstruction": 2, "generator": 3},
    "output": {"directory": "o", "checkpoint_minutes": 0, "image_minutes": 0.5}})");
  EXPECT_EQ(manifest.seed, 9u);
  RecordingSpec first{"a", RecordingFormat::kMvsec, {}, 2.5, 3, 8, std::nullopt};
  first.options.camera = "right";
  EXPECT_EQ(manifest.recordings.at(0), first);
  EXPECT_EQ(manifest.recordings.at(1),
            (RecordingSpec{"b", RecordingFormat::kEcd, {}, 1, 0, std::nullopt, std::nullopt}));
  EXPECT_EQ(manifest.validation.at(0).format, RecordingFormat::kEventgan);
  EXPECT_THAT(manifest.gaps, ::testing::ElementsAre(1, 3));
  EXPECT_EQ(manifest.crop, (ImageSize{.height = 64, .width = 96}));
  EXPECT_EQ(manifest.batch, 4);
  EXPECT_EQ(manifest.network.generator_channels, 8);
  EXPECT_EQ(manifest.network.discriminator_channels, 16);
  EXPECT_EQ(manifest.network.cycle_channels, 4);
  EXPECT_EQ(manifest.network.spectral_norm, SpectralNormPlace::kEncoders);
  EXPECT_EQ(manifest.network.bins, 5);
  EXPECT_EQ(manifest.network.output_slope, 0.25);
  EXPECT_EQ(manifest.network.difference_gain, 6);
  EXPECT_EQ(manifest.losses.adversarial, 0.5);
  EXPECT_EQ(manifest.losses.flow, 2);
  EXPECT_EQ(manifest.losses.reconstruction, 3);
  EXPECT_EQ(manifest.losses.volume, 4);
  EXPECT_EQ(manifest.losses.count, 6);
  EXPECT_EQ(manifest.losses.overlap, 7);
  EXPECT_EQ(manifest.losses.quantile, 0.7);
  EXPECT_EQ(manifest.losses.smoothness, 5);
  EXPECT_EQ(manifest.label_flip, 0.2);
  EXPECT_EQ(manifest.discriminator_steps, 3);
  EXPECT_FALSE(manifest.augmentation.flip);
  EXPECT_EQ(manifest.augmentation.gain, (std::array{0.5, 2.0}));
  EXPECT_EQ(manifest.augmentation.gamma, (std::array{0.8, 1.25}));
  EXPECT_TRUE(manifest.augmentation.reverse);
  EXPECT_EQ(manifest.augmentation.static_fraction, 0.1);
  EXPECT_EQ(manifest.augmentation.event_fraction, 0.3);
  EXPECT_EQ(manifest.optimizer.generator_rate, 1e-3);
  EXPECT_EQ(manifest.optimizer.cycle_rate, 2e-3);
  EXPECT_EQ(manifest.optimizer.discriminator_rate, 3e-3);
  EXPECT_EQ(manifest.optimizer.betas, (std::array{0.5, 0.9}));
  EXPECT_EQ(manifest.optimizer.final_rate_fraction, 0.01);
  EXPECT_EQ(manifest.precision, TrainingPrecision::kBfloat16);
  EXPECT_EQ(manifest.steps.flow, 1);
  EXPECT_EQ(manifest.steps.reconstruction, 2);
  EXPECT_EQ(manifest.steps.generator, 3);
  EXPECT_EQ(manifest.output_directory, "o");
  EXPECT_EQ(manifest.checkpoint_minutes, 0);
  EXPECT_EQ(manifest.image_minutes, 0.5);
  EXPECT_EQ(resolve(manifest, "a"), "/data/a");
}

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

TEST(TrainingSchema, IsClosedDescribedAndStatesTheDefaults) {
  EXPECT_EQ(testing::open_or_undescribed(kTrainingSchema), "");
  const TrainingManifest manifest = parse_training(kSoundTraining);
  const auto stated = [](const std::string& pointer) {
    return testing::stated_default(kTrainingSchema, pointer);
  };
  const auto section = [&](const std::string& name, const std::string& key) {
    return stated("/properties/" + name + "/properties/" + key);
  };
  EXPECT_EQ(stated("/properties/seed"), manifest.seed);
  EXPECT_EQ(stated("/properties/batch"), manifest.batch);
  EXPECT_EQ(stated("/properties/label_flip"), manifest.label_flip);
  EXPECT_EQ(stated("/properties/discriminator_steps"), manifest.discriminator_steps);
  EXPECT_EQ(stated("/properties/precision"), to_string(manifest.precision));
  EXPECT_EQ(section("network", "generator_channels"), manifest.network.generator_channels);
  EXPECT_EQ(section("network", "discriminator_channels"), manifest.network.discriminator_channels);
  EXPECT_EQ(section("network", "cycle_channels"), manifest.network.cycle_channels);
  EXPECT_EQ(section("network", "spectral_norm"), to_string(manifest.network.spectral_norm));
  EXPECT_EQ(section("network", "bins"), manifest.network.bins);
  EXPECT_EQ(section("network", "output_slope"), manifest.network.output_slope);
  EXPECT_EQ(section("network", "difference_gain"), manifest.network.difference_gain);
  EXPECT_EQ(section("losses", "adversarial"), manifest.losses.adversarial);
  EXPECT_EQ(section("losses", "volume"), manifest.losses.volume);
  EXPECT_EQ(section("losses", "count"), manifest.losses.count);
  EXPECT_EQ(section("losses", "overlap"), manifest.losses.overlap);
  EXPECT_EQ(section("losses", "likelihood"), manifest.losses.likelihood);
  EXPECT_EQ(section("losses", "block_likelihood"), manifest.losses.block_likelihood);
  EXPECT_EQ(section("losses", "quantile"), manifest.losses.quantile);
  EXPECT_EQ(section("losses", "smoothness"), manifest.losses.smoothness);
  EXPECT_EQ(section("network", "sensor"), manifest.network.sensor);
  EXPECT_EQ(section("simulated", "fraction"), SimulatedSpec().fraction);
  EXPECT_EQ(section("augmentation", "flip"), manifest.augmentation.flip);
  EXPECT_EQ(section("augmentation", "reverse"), manifest.augmentation.reverse);
  EXPECT_EQ(section("augmentation", "static_fraction"), manifest.augmentation.static_fraction);
  EXPECT_EQ(section("augmentation", "event_fraction"), manifest.augmentation.event_fraction);
  EXPECT_EQ(section("optimizer", "generator_rate"), manifest.optimizer.generator_rate);
  EXPECT_EQ(section("optimizer", "cycle_rate"), manifest.optimizer.cycle_rate);
  EXPECT_EQ(section("optimizer", "discriminator_rate"), manifest.optimizer.discriminator_rate);
  EXPECT_EQ(section("optimizer", "final_rate_fraction"), manifest.optimizer.final_rate_fraction);
  EXPECT_EQ(section("output", "checkpoint_minutes"), manifest.checkpoint_minutes);
  EXPECT_EQ(section("output", "image_minutes"), manifest.image_minutes);
  EXPECT_EQ(stated("/properties/recordings/items/properties/weight"), RecordingSpec().weight);
  EXPECT_EQ(stated("/properties/recordings/items/properties/threshold_ratio"),
            ContrastThreshold().ratio);
}

}  // namespace
}  // namespace eventgan
