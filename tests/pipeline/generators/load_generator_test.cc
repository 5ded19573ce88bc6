#include "pipeline/generators/load_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <memory>
#include <set>

#include "manifests/documents/sensor_document.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "pipeline/generators/choose_engine.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/weights.h"
#include "stages/generator/weights_file.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::texts_with;

TEST(EngineSupport, IsOfOnePieceAndLibtorchAlwaysHasFloat32AndNeverInt8) {
  EXPECT_TRUE(engine_support(Precision::kFloat32).torch_able);
  EXPECT_FALSE(engine_support(Precision::kInt8).torch_able);
  for (const Precision precision : {Precision::kFloat32, Precision::kBfloat16, Precision::kInt8}) {
    const EngineSupport support = engine_support(precision);
    EXPECT_NE(support.processor, "");
    EXPECT_TRUE(support.onednn_built || !support.onednn_able);
    EXPECT_EQ(support.processor, engine_support(Precision::kFloat32).processor);
  }
}

using enum Engine;
using enum Precision;

/// Everything works, and well.
EngineSupport all_of(const std::string& processor = "avx512_core_amx") {
  return {.onednn_built = true,
          .onednn_able = true,
          .torch_able = true,
          .native = true,
          .processor = processor};
}

EngineRequest request(std::optional<Engine> engine, Precision precision, bool calibrated = false) {
  return {engine, precision, calibrated, "w.safetensors"};
}

std::string refusal(const EngineRequest& request, const EngineSupport& support) {
  try {
    choose_engine(request, support);
    return "";
  } catch (const UsageError& error) {
    return error.what();
  }
}

TEST(ChooseEngine, AutoTakesOnednnWhereItIsAbleElseLibtorchAndSaysWhy) {
  EngineChoice choice = choose_engine(request({}, kFloat32), all_of());
  EXPECT_EQ(choice.engine, kOnednn);
  EXPECT_EQ(choice.reason, "");
  EXPECT_EQ(choice.warning, "");
  EngineSupport support = all_of("sse41");
  support.onednn_able = false;
  choice = choose_engine(request({}, kFloat32), support);
  EXPECT_EQ(choice.engine, kTorch);
  EXPECT_EQ(choice.reason, "oneDNN has no compiled kernels for float32 on this processor (sse41)");
  support.onednn_built = false;
  choice = choose_engine(request({}, kFloat32), support);
  EXPECT_EQ(choice.engine, kTorch);
  EXPECT_EQ(choice.reason, "this program was built without oneDNN");
}

TEST(ChooseEngine, AnAskedOneIsTakenOrRefusedWithWhatWouldWork) {
  for (const Engine engine : {kTorch, kOnednn}) {
    for (const Precision precision : {kFloat32, kBfloat16}) {
      const EngineChoice choice = choose_engine(request(engine, precision), all_of());
      EXPECT_EQ(choice.engine, engine);
      EXPECT_EQ(choice.reason, "");
      EXPECT_EQ(choice.warning, "");
    }
  }
  EngineSupport support = all_of();
  support.onednn_built = support.onednn_able = false;
  EXPECT_EQ(refusal(request(kOnednn, kFloat32), support),
            "$.generator.engine: expected \"auto\" or \"torch\" for float32, got \"onednn\": this "
            "program was built without oneDNN");
}

TEST(ChooseEngine, Int8IsOnednnsAlone) {
  EngineSupport support = all_of();
  support.torch_able = false;
  EXPECT_EQ(choose_engine(request({}, kInt8, true), support).engine, kOnednn);
  EXPECT_EQ(choose_engine(request(kOnednn, kInt8, true), support).engine, kOnednn);
  EXPECT_EQ(refusal(request(kTorch, kInt8, true), support),
            "$.generator.engine: expected \"auto\" or \"onednn\" for int8, got \"torch\": LibTorch "
            "has no int8 for this network");
  support.onednn_built = support.onednn_able = false;
  for (const std::optional<Engine> engine : {std::optional<Engine>(), {kTorch}, {kOnednn}}) {
    EXPECT_EQ(refusal(request(engine, kInt8, true), support),
              "$.generator.precision: expected \"float32\", got \"int8\": this program was built "
              "without oneDNN, and LibTorch has no int8 for this network");
  }
}

TEST(ChooseEngine, AutomaticPrecisionIsWhatTheProcessorDoesWell) {
  const EngineSupport able = all_of("avx512_core_bf16");
  EXPECT_EQ(choose_precision({}, Device::kCpu, able), kBfloat16);
  EXPECT_EQ(choose_precision(kOnednn, Device::kCpu, able), kBfloat16);
  EngineSupport support = able;
  support.onednn_able = false;
  EXPECT_EQ(choose_precision({}, Device::kCpu, support), kBfloat16);
  EXPECT_EQ(choose_precision(kOnednn, Device::kCpu, support), kFloat32);
  support.torch_able = false;
  EXPECT_EQ(choose_precision({}, Device::kCpu, support), kFloat32);
  support = able;
  support.native = false;  // computed, but slower than float32
  EXPECT_EQ(choose_precision({}, Device::kCpu, support), kFloat32);
  EXPECT_EQ(choose_precision({}, Device::kCuda, support), kFloat32);  // there is none
  support.cuda = "Tesla T4";
  support.cuda_lack = "Tesla T4 has no bfloat16";
  EXPECT_EQ(choose_precision({}, Device::kCuda, support), kFloat32);
  support.cuda_lack = "";
  EXPECT_EQ(choose_precision({}, Device::kCuda, support), kBfloat16);
}

TEST(ChooseEngine, Int8NeedsACalibration) {
  EXPECT_EQ(refusal(request({}, kInt8), all_of()),
            "$.generator.weights: expected weights with a calibration for int8, got w.safetensors "
            "without one; run eventgan calibrate MANIFEST");
  EXPECT_EQ(choose_engine(request({}, kFloat32), all_of()).engine, kOnednn);
}

TEST(ChooseEngine, WarnsWhereTheProcessorHasNoInstructionsForThePrecision) {
  EngineSupport support = all_of("avx512_core");
  support.native = false;
  EXPECT_EQ(choose_engine(request({}, kBfloat16), support).warning,
            "precision bfloat16: this processor (avx512_core) has no instructions for it; float32 "
            "is both faster and exact here");
  EXPECT_EQ(choose_engine(request({}, kInt8, true), support).warning,
            "precision int8: this processor (avx512_core) has no instructions for it, so it gains "
            "less than elsewhere; float32 is exact");
  EXPECT_EQ(choose_engine(request({}, kFloat32), support).warning, "");
  EXPECT_NE(choose_engine(request(kTorch, kBfloat16), support).warning, "");
}

TEST(ChooseEngine, RefusesBfloat16WhereNothingComputesItInReasonableTime) {
  EngineSupport support = all_of("avx2");
  support.onednn_able = support.torch_able = support.native = false;
  for (const std::optional<Engine> engine : {std::optional<Engine>(), {kTorch}, {kOnednn}}) {
    EXPECT_EQ(refusal(request(engine, kBfloat16), support),
              "$.generator.precision: expected \"float32\", got \"bfloat16\": oneDNN has no "
              "compiled kernels for bfloat16 on this processor (avx2), and LibTorch has no fast "
              "kernels for bfloat16 on this processor (avx2)");
  }
}

EngineSupport cuda_of(const std::string& device, const std::string& lack) {
  EngineSupport support = all_of();
  support.cuda = device;
  support.cuda_lack = lack;
  return support;
}

EngineRequest on_cuda(std::optional<Engine> engine, Precision precision) {
  EngineRequest asked = request(engine, precision);
  asked.device = Device::kCuda;
  return asked;
}

TEST(ChooseEngine, OnCudaItIsLibtorch) {
  EngineSupport support = cuda_of("cuda: NVIDIA H100 (compute capability 9.0)", "");
  // What the processor lacks does not matter.
  support.onednn_built = support.onednn_able = support.torch_able = support.native = false;
  for (const Precision precision : {kFloat32, kBfloat16}) {
    EngineChoice choice = choose_engine(on_cuda({}, precision), support);
    EXPECT_EQ(choice.engine, kTorch);
    EXPECT_EQ(choice.reason, "");
    EXPECT_EQ(choice.warning, "");
    choice = choose_engine(on_cuda(kTorch, precision), support);
    EXPECT_EQ(choice.engine, kTorch);
    EXPECT_EQ(choice.reason, "");
  }
  EXPECT_EQ(refusal(on_cuda(kOnednn, kFloat32), support),
            "$.generator.engine: expected \"auto\" or \"torch\" on device cuda, got \"onednn\", "
            "which runs on the CPU only");
  EXPECT_EQ(refusal(on_cuda({}, kInt8), support),
            "$.generator.precision: expected \"float32\" or \"bfloat16\" on device cuda, got "
            "\"int8\", which only oneDNN on the CPU has");
}

TEST(ChooseEngine, RefusesCudaWhereThereIsNoneAndBfloat16WhereTheDeviceHasNone) {
  EXPECT_EQ(refusal(on_cuda({}, kFloat32), cuda_of("", "LibTorch was built without CUDA")),
            "$.generator.device: expected \"cpu\", got \"cuda\": LibTorch was built without CUDA");
  EXPECT_EQ(
      refusal(on_cuda({}, kBfloat16), cuda_of("cuda: Tesla T4", "Tesla T4 has no bfloat16")),
      "$.generator.precision: expected \"float32\", got \"bfloat16\": Tesla T4 has no bfloat16");
}

/// Weights that do not say of themselves that they are untrained.
Weights trained_weights() {
  Weights weights = untrained_weights(1, 9, 1);
  weights.metadata["origin"] = "a test";
  return weights;
}

TEST(LoadGenerator, ReadsAFileBesideTheManifest) {
  const testing::TemporaryFolder folder;
  const std::string bytes = serialize_weights(trained_weights());
  testing::write_file(folder / "w.safetensors", bytes);
  JobManifest manifest;
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.generator->bins(), 9);
  EXPECT_EQ(loaded.weights_hash, sha256_hex(bytes));
  EXPECT_THAT(loaded.warnings, ::testing::IsEmpty());
  manifest.volume.bins = 5;
  EXPECT_THROWS(load_generator(manifest), UsageError,
                "$.volume.bins: expected 9 as in the weights, got 5");
}

TEST(LoadGenerator, WarnsLoudlyOfAnUntrainedOneFromAFileToo) {
  JobManifest manifest;
  manifest.generator.weights = "untrained:2";
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_THAT(loaded.warnings, texts_with({"UNTRAINED"}));
  manifest.seed = 1;
  EXPECT_NE(load_generator(manifest).weights_hash, loaded.weights_hash);
  const testing::TemporaryFolder folder;
  testing::write_file(folder / "w.safetensors", serialize_weights(untrained_weights(1, 9, 1)));
  manifest = JobManifest();
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  EXPECT_THAT(load_generator(manifest).warnings, texts_with({"UNTRAINED (w.safetensors)"}));
}

TEST(LoadGenerator, MakesTheEngineThatIsAskedForAndSaysWhich) {
  JobManifest manifest;
  manifest.generator.weights = "untrained:1";
  manifest.generator.engine = Engine::kTorch;
  const LoadedGenerator torch = load_generator(manifest);
  EXPECT_THAT(torch.choice, ::testing::StartsWith("generator: torch float32 on "));
  EXPECT_THAT(torch.choice, ::testing::EndsWith(", training gaps unknown"));
  // Where this changes, folders that were begun before are refused.
  EXPECT_THAT(torch.generator->description(),
              ::testing::StartsWith("torch float32, 1 thread, LibTorch "));
  EXPECT_THAT(torch.generator->description(), ::testing::Not(::testing::HasSubstr("cuda")));

  manifest.generator.engine = std::nullopt;
  const EngineSupport support = engine_support(Precision::kFloat32);
  const LoadedGenerator fastest = load_generator(manifest);
  const std::string name = support.onednn_able ? "onednn float32" : "torch float32";
  EXPECT_THAT(fastest.choice,
              ::testing::StartsWith("generator: " + name + " on " + support.processor));
  EXPECT_THAT(fastest.generator->description(), ::testing::StartsWith(name));
}

TEST(LoadGenerator, KnowsWhatGapsTheWeightsWereTrainedOn) {
  const testing::TemporaryFolder folder;
  Weights weights = trained_weights();
  weights.training_gaps = GapRange{1, 5};
  testing::write_file(folder / "w.safetensors", serialize_weights(weights));
  JobManifest manifest;
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  for (const std::optional<Engine> engine : {std::optional<Engine>(), {Engine::kTorch}}) {
    manifest.generator.engine = engine;
    const LoadedGenerator loaded = load_generator(manifest);
    EXPECT_EQ(loaded.generator->training_gaps(), (GapRange{1, 5}));
    EXPECT_THAT(loaded.choice, ::testing::EndsWith(", trained on gaps 1-5"));
    EXPECT_THAT(loaded.generator->description(), ::testing::EndsWith(", trained on gaps 1-5"));
  }
}

class LoadSensorGenerator : public ::testing::Test {
 protected:
  LoadSensorGenerator() {
    Weights weights = testing::untrained_sensor_weights(1, 9, 1);  // of thresholds 0.1 to 0.4
    weights.metadata["origin"] = "a test";
    testing::write_file(folder_ / "w.safetensors", serialize_weights(weights));
    manifest_.directory = folder_.path();
    manifest_.generator.weights = "w.safetensors";
  }

  std::string refusal(std::array<double, 2> range, double ratio = 1) {
    manifest_.generator.threshold = ThresholdSpec{.range = range, .ratio = ratio};
    try {
      load_generator(manifest_);
      return "";
    } catch (const UsageError& error) {
      return error.what();
    }
  }

  testing::TemporaryFolder folder_;
  JobManifest manifest_;
};

TEST_F(LoadSensorGenerator, KnowsItsThresholds) {
  for (const std::optional<Engine> engine : {std::optional<Engine>(), {Engine::kTorch}}) {
    manifest_.generator.engine = engine;
    const LoadedGenerator loaded = load_generator(manifest_);
    EXPECT_EQ(loaded.generator->thresholds(), (ThresholdRange{0.1, 0.4}));
    EXPECT_THAT(loaded.warnings, ::testing::IsEmpty());
  }
}

TEST_F(LoadSensorGenerator, TakesThresholdsThatItLearntAndNoOthers) {
  for (const std::array<double, 2> learnt :
       {std::array{0.1, 0.4}, {0.1, 0.1}, {0.4, 0.4}, {0.2, 0.3}}) {
    EXPECT_EQ(refusal(learnt), "");
  }
  EXPECT_EQ(refusal({0.0999, 0.3}),
            "$.generator.sensor.threshold: expected 0.1..0.4 as the weights have learnt, got "
            "0.0999..0.3");
  EXPECT_EQ(refusal({0.2, 0.5}),
            "$.generator.sensor.threshold: expected 0.1..0.4 as the weights have learnt, got "
            "0.2..0.5");
  EXPECT_NE(refusal({0.05, 5}), "");
  // Of either polarity.
  EXPECT_EQ(refusal({0.21, 0.21}, 3.6), "");
  EXPECT_EQ(refusal({0.2, 0.22}, 4),
            "$.generator.sensor.threshold: expected 0.1..0.4 as the weights have learnt, got "
            "0.1..0.44 with threshold_ratio 4");
}

TEST(LoadGenerator, ShippedWeightsTakeTheShippedSensors) {
  JobManifest manifest;
  manifest.generator.weights = "shipped:sensor";
  for (const std::string& name : shipped_sensors()) {
    const CameraSensor sensor = open_camera_sensor(name);
    manifest.generator.threshold = sensor.network->threshold;
    manifest.generator.threshold_weights = sensor.network->weights;
    EXPECT_TRUE(load_generator(manifest).generator->thresholds()) << name;
  }
}

TEST_F(LoadSensorGenerator, RefusesThresholdsOfOtherWeights) {
  manifest_.generator.threshold_weights = sha256_hex(testing::read_file(folder_ / "w.safetensors"));
  EXPECT_EQ(refusal({0.2, 0.2}), "");
  manifest_.generator.threshold_weights = sha256_hex("others");
  EXPECT_EQ(
      refusal({0.2, 0.2}),
      "$.generator.sensor.network: expected the threshold of w.safetensors, got that of other "
      "weights (eventgan fit --weights finds it)");
}

TEST_F(LoadSensorGenerator, RefusesThresholdsForWeightsThatLearntNone) {
  testing::write_file(folder_ / "w.safetensors", serialize_weights(trained_weights()));
  EXPECT_EQ(refusal({0.2, 0.2}),
            "$.generator.sensor.threshold: expected weights that have learnt a sensor's threshold, "
            "got others: w.safetensors");
  manifest_.generator.threshold.reset();
  EXPECT_EQ(load_generator(manifest_).generator->thresholds(), std::nullopt);
}

TEST(LoadGenerator, MakesTheOneOnCudaOrRefusesIt) {
  JobManifest manifest;
  manifest.generator.weights = "untrained:1";
  manifest.generator.device = Device::kCuda;
  const EngineSupport support = engine_support(Precision::kFloat32, Device::kCuda);
  if (!support.cuda_lack.empty()) {
    EXPECT_THROWS(load_generator(manifest), UsageError,
                  "$.generator.device: expected \"cpu\", got \"cuda\"");
    return;
  }
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_THAT(loaded.choice, ::testing::StartsWith("generator: torch float32 on cuda: "));
  EXPECT_THAT(loaded.generator->description(), ::testing::StartsWith("torch float32 on cuda: "));
}

TEST(LoadGenerator, RefusesInt8WithoutACalibration) {
  JobManifest manifest;
  manifest.generator.weights = "untrained:1";
  manifest.generator.precision = Precision::kInt8;
  EXPECT_THROWS(load_generator(manifest), UsageError,
                "$.generator.weights: expected weights with a calibration");
}

TEST(LoadGenerator, RefusesWeightsThatInt8CannotServe) {
  if (!engine_support(Precision::kInt8).onednn_able) GTEST_SKIP() << "no int8 here";
  const testing::TemporaryFolder folder;
  Weights weights = trained_weights();
  weights.calibration = std::make_shared<const Calibration>(testing::sample_calibration(1, 1));
  JobManifest manifest;
  manifest.directory = folder.path();
  manifest.generator.weights = "w.safetensors";
  manifest.generator.precision = Precision::kInt8;
  testing::write_file(folder / "w.safetensors", serialize_weights(weights));
  EXPECT_THAT(load_generator(manifest).choice, ::testing::StartsWith("generator: onednn int8 on "));
  weights.convolutions[2].bias[0] = std::numeric_limits<float>::max();
  testing::write_file(folder / "w.safetensors", serialize_weights(weights));
  EXPECT_THROWS(load_generator(manifest), InputError,
                "cannot use the weights w.safetensors in int8");
}

TEST(LoadGenerator, SetsUpSimulators) {
  JobManifest manifest;
  manifest.volume.bins = 5;
  manifest.generator.kind = GeneratorKind::kDifference;
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.generator->bins(), 5);
  EXPECT_EQ(loaded.generator->training_gaps(), std::nullopt);
  EXPECT_THAT(loaded.warnings, ::testing::IsEmpty());
  EXPECT_EQ(loaded.choice, "");
  EXPECT_EQ(loaded.weights_hash, sha256_hex(loaded.generator->description()));
  manifest.generator.kind = GeneratorKind::kEsim;
  EXPECT_NE(load_generator(manifest).weights_hash, loaded.weights_hash);
}

TEST(LoadGenerator, MakesEveryKind) {
  std::set<std::string> hashes;
  for (const GeneratorRow& row : kGenerators) {
    JobManifest manifest;
    manifest.generator.kind = row.value;
    manifest.generator.weights = "untrained:1";
    const LoadedGenerator loaded = load_generator(manifest);
    EXPECT_EQ(loaded.generator->bins(), 9) << row.word;
    EXPECT_EQ(loaded.choice.empty(), !row.has_weights) << row.word;
    EXPECT_EQ(weights_warning(manifest).empty(), !row.has_weights) << row.word;
    hashes.insert(loaded.weights_hash);
  }
  EXPECT_EQ(hashes.size(), kGenerators.size());
}

TEST(LoadGenerator, OfACamerasEventsGeneratesNone) {
  JobManifest manifest;
  manifest.generator.kind = GeneratorKind::kEvents;
  manifest.volume.bins = 3;
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.generator->bins(), 3);
  EXPECT_EQ(loaded.generator->description(), "events of a camera");
  EXPECT_EQ(loaded.generator->training_gaps(), std::nullopt);
  EXPECT_EQ(loaded.weights_hash, sha256_hex("events of a camera"));
  // 6 channels of 4 pixels, sums in double.
  EXPECT_EQ(loaded.generator->working_bytes({2, 2}), 6u * 4 * 8);
  std::vector<float> frames(8), volume(24);
  EXPECT_THROWS(loaded.generator->generate({frames, {2, 2}}, volume), std::logic_error,
                "expected frames to generate events from, got events");
  EXPECT_TRUE(loaded.warnings.empty());
}

TEST(LoadGenerator, FindsTheShippedWeightsOrSaysThatThereAreNone) {
  JobManifest manifest;
  EXPECT_EQ(manifest.generator.weights, "shipped");
  if (shipped_widths().empty()) {
    EXPECT_THROWS(load_generator(manifest), InputError, "expected shipped weights of a base width");
    return;
  }
  const int width = default_shipped_width();
  const LoadedGenerator loaded = load_generator(manifest);
  EXPECT_EQ(loaded.weights_hash, sha256_hex(shipped_weights_bytes(width)));
  EXPECT_THAT(loaded.warnings, texts_with({"shipped:" + std::to_string(width) + " are stand-in"}));
  manifest.generator.weights = "shipped:" + std::to_string(width);
  EXPECT_EQ(load_generator(manifest).weights_hash, loaded.weights_hash);
  manifest.generator.weights = "shipped:63";
  EXPECT_THROWS(load_generator(manifest), InputError,
                "expected a base width of the shipped weights (8, 16)");
}

TEST(LoadGenerator, RefusesAMissingFileAndAWidthThatIsNone) {
  JobManifest manifest;
  manifest.directory = "/nowhere";
  manifest.generator.weights = "w.safetensors";
  EXPECT_THROWS(load_generator(manifest), InputError,
                "cannot use the weights in /nowhere/w.safetensors");
  for (const char* weights :
       {"untrained:", "untrained:0", "untrained:8x", "untrained:1000", "shipped:", "shipped:0"}) {
    manifest.generator.weights = weights;
    EXPECT_THROWS(load_generator(manifest), UsageError,
                  "$.generator.weights: expected a file, shipped")
        << weights;
  }
}

}  // namespace
}  // namespace eventgan
