#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "manifests/values/counter_random.h"
#include "pipeline/conversion/sample_stages.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/shards/codec/quantization.h"
#include "stages/shards/codec/volume_codec.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/texts.h"

// What becomes of images, weights and calibrations at the ends of what numbers can say, for every
// engine, precision and width of shipped weights: three tables of cases, each with its outcome,
// which manifests/guides/numerics.md has for people. A pair goes the way of a conversion, from the
// frames to the bytes of a chunk, in every type of storage.

namespace eventgan {
namespace {

using testing::natural_frames;

constexpr ImageSize kSize{24, 32};
constexpr ImageSize kCalibrated{48, 64};

enum class Outcome {
  kVolume,       // valid: near the reference in float32; in int8 near it, or flagged
  kEmpty,        // valid: zeros (and whatever is zeros is flagged as that)
  kFlagged,      // valid: finite, and flagged as beyond the calibration
  kQuarantined,  // NaN or infinity came of it: no bytes, and a reason
  kRefused,      // before any pair
};

/// Frames [2, y, x] from a grey level 0..255.
template <class Level>
std::vector<float> frames_of(ImageSize size, Level level) {
  std::vector<float> frames;
  for (int frame = 0; frame < 2; ++frame) {
    for (int y = 0; y < size.height; ++y) {
      for (int x = 0; x < size.width; ++x) {
        frames.push_back(static_cast<float>(level(frame, y, x) / 127.5 - 1));
      }
    }
  }
  return frames;
}

std::vector<float> natural(ImageSize size) { return natural_frames(size, 5); }

std::vector<float> with_equal_frames(std::vector<float> frames) {
  std::copy_n(frames.begin(), frames.size() / 2, frames.begin() + std::ssize(frames) / 2);
  return frames;
}

// ---- The cases

struct ImageCase {
  const char* name;
  ImageSize size;  // height, width
  std::vector<float> (*frames)(ImageSize);
};

/// The outcome of each is kVolume.
const ImageCase kImages[] = {
    {"one pixel", {1, 1}, natural},
    {"one row", {1, 33}, natural},
    {"one column", {33, 1}, natural},
    {"2x2", {2, 2}, natural},
    {"15x16", {15, 16}, natural},
    {"16x17", {16, 17}, natural},
    {"17x15", {17, 15}, natural},
    {"31x33", {31, 33}, natural},
    {"33x31", {33, 31}, natural},
    {"black", kSize, [](ImageSize s) { return frames_of(s, [](int, int, int) { return 0; }); }},
    {"white", kSize, [](ImageSize s) { return frames_of(s, [](int, int, int) { return 255; }); }},
    {"black to white", kSize,
     [](ImageSize s) { return frames_of(s, [](int frame, int, int) { return 255 * frame; }); }},
    {"equal frames", kSize, [](ImageSize s) { return with_equal_frames(natural(s)); }},
    {"inverted", kSize,
     [](ImageSize s) {
       std::vector<float> frames = with_equal_frames(natural(s));
       for (std::size_t i = frames.size() / 2; i < frames.size(); ++i) frames[i] = -frames[i];
       return frames;
     }},
    {"one pixel differs", kSize,
     [](ImageSize s) {
       std::vector<float> frames = with_equal_frames(natural(s));
       frames.back() = frames.back() > 0 ? -1.0f : 1.0f;
       return frames;
     }},
    {"checkerboard that changes sides", kSize,
     [](ImageSize s) {
       return frames_of(s, [](int frame, int y, int x) { return (frame + y + x) % 2 * 255; });
     }},
    {"gradient", kSize,
     [](ImageSize s) {
       return frames_of(s, [](int frame, int y, int x) { return 4.0 * (x + frame) + y; });
     }},
    {"noise", kSize,
     [](ImageSize s) {
       return frames_of(s, [random = CounterRandom(3), drawn = std::uint64_t{0}](
                               int, int, int) mutable { return 255 * random.uniform(drawn++); });
     }},
    {"saturated halves that change sides", kSize,
     [](ImageSize s) {
       return frames_of(s,
                        [](int frame, int, int x) { return (x < 16) == (frame == 0) ? 0 : 255; });
     }},
    {"levels between those of 8 bits", kSize,
     [](ImageSize s) {
       return frames_of(s, [](int frame, int y, int x) { return 100 + (frame + x + y) / 257.0; });
     }},
};

Convolution& layer(Weights& weights, const std::string& name) {
  return *std::ranges::find(weights.convolutions, name, &Convolution::name);
}

void scale(std::vector<float>& numbers, int exponent) {
  for (float& number : numbers) number = std::ldexp(number, exponent);
}

/// All activations 2^exponent times as large, and the same volume: the network is homogeneous in
/// its first layer's weights and the biases.
void scale_activations(Weights& weights, int exponent) {
  scale(layer(weights, "head").weight, exponent);
  for (Convolution& each : weights.convolutions) {
    if (each.name != "pred") scale(each.bias, exponent);
  }
  scale(layer(weights, "pred").weight, -exponent);
}

struct WeightsCase {
  const char* name;
  void (*change)(Weights&);
  Outcome in_floats;  // kVolume: that of the weights before the change
  Outcome in_int8;    // calibrated after the change
};

const WeightsCase kWeights[] = {
    {"as they are", [](Weights&) {}, Outcome::kVolume, Outcome::kVolume},
    {"activations times 1e4", [](Weights& w) { scale_activations(w, 13); }, Outcome::kVolume,
     Outcome::kVolume},
    {"activations times 1e10", [](Weights& w) { scale_activations(w, 33); }, Outcome::kVolume,
     Outcome::kVolume},
    {"activations times 1e30", [](Weights& w) { scale_activations(w, 100); }, Outcome::kVolume,
     Outcome::kVolume},
    {"activations times 1e-10", [](Weights& w) { scale_activations(w, -33); }, Outcome::kVolume,
     Outcome::kVolume},
    // 1e30 in all channels, times 1e10; then weights of both signs make NaN of infinities.
    {"activations that overflow",
     [](Weights& w) {
       std::ranges::fill(layer(w, "head").bias, 1e30f);
       std::ranges::fill(layer(w, "encoders.0").weight, 1e10f);
     },
     Outcome::kQuarantined, Outcome::kRefused},
    {"all zero",
     [](Weights& w) {
       for (Convolution& each : w.convolutions) {
         std::ranges::fill(each.weight, 0.0f);
         std::ranges::fill(each.bias, 0.0f);
       }
     },
     Outcome::kEmpty, Outcome::kEmpty},
    {"NaN in one place", [](Weights& w) { layer(w, "decoders.1").weight[7] = std::nanf(""); },
     Outcome::kRefused, Outcome::kRefused},
    {"infinity in one place",
     [](Weights& w) { layer(w, "pred").bias[0] = std::numeric_limits<float>::infinity(); },
     Outcome::kRefused, Outcome::kRefused},
};

void scale_ranges(Calibration& calibration, float factor) {
  for (TensorStatistics& tensor : calibration.tensors) {
    for (float& highest : tensor.highest) highest *= factor;
  }
}

struct CalibrationCase {
  const char* name;
  void (*change)(Calibration&);
  Outcome in_int8;
};

const CalibrationCase kCalibrations[] = {
    {"activations 100 times beyond", [](Calibration& c) { scale_ranges(c, 0.01f); },
     Outcome::kFlagged},
    {"one tensor 100 times beyond",
     [](Calibration& c) {
       for (float& highest : c.tensors[7].highest) highest *= 0.01f;
     },
     Outcome::kFlagged},
    {"ranges of 0", [](Calibration& c) { scale_ranges(c, 0); }, Outcome::kFlagged},
    {"a range of infinity",
     [](Calibration& c) { c.tensors[3].highest[0] = std::numeric_limits<float>::infinity(); },
     Outcome::kRefused},
    {"a range of NaN", [](Calibration& c) { c.tensors[3].highest[0] = std::nanf(""); },
     Outcome::kRefused},
};

// ---- What runs them

struct EngineCase {
  Engine engine = Engine::kTorch;
  Precision precision = Precision::kFloat32;
  int width = 0;
};

class Extremes : public ::testing::TestWithParam<EngineCase> {
 protected:
  void SetUp() override {
    const bool torch = GetParam().engine == Engine::kTorch;
    if (torch && precision_ == Precision::kFloat32) return;
    const OnednnSupport support = onednn_support(precision_);
    if (support.built ? !support.able : !torch) {
      GTEST_SKIP() << support.instruction_set << " does not compute " << to_string(precision_);
    }
  }

  std::unique_ptr<Generator> engine(const Weights& weights) const {
    if (GetParam().engine == Engine::kTorch) return make_torch_generator(weights, precision_);
    return make_onednn_generator(weights, precision_);
  }

  Weights ready(const Weights& weights) const {
    return precision_ == Precision::kInt8 ? testing::calibrated(weights, kCalibrated) : weights;
  }

  /// Converts the frames and compares what came of them with what should; `reference`: the volume
  /// in float32, for kVolume.
  void expect_outcome(const std::string& name, const Generator& generator,
                      const std::vector<float>& frames, ImageSize size, Outcome expected,
                      const std::vector<float>& reference) const {
    SCOPED_TRACE(name);
    const std::vector<float> made = testing::generated(generator, frames, size);
    const auto next = frames.begin() + static_cast<std::ptrdiff_t>(size.pixel_count());
    const bool is_same_image = std::equal(next, frames.end(), frames.begin());
    const std::vector<float> volume = is_same_image ? std::vector<float>(made.size()) : made;
    for (const StoredType type : {StoredType::kFloat32, StoredType::kFloat16, StoredType::kUint8}) {
      const SampleMessage message = converted(generator, frames, size, type);
      ASSERT_EQ(message.failed(), expected == Outcome::kQuarantined) << message.sample.fault;
      EXPECT_EQ(message.chunk.empty(), message.failed());
      if (message.failed()) continue;
      const std::uint32_t flags = message.sample.statistics.flags;
      EXPECT_EQ((flags & kFlagEmpty) != 0, std::ranges::max(volume) == 0);
      EXPECT_TRUE(expected != Outcome::kEmpty || (flags & kFlagEmpty));
      EXPECT_TRUE(expected != Outcome::kFlagged || (flags & kFlagBeyondCalibration));
      expect_sound_chunk(message, volume, type);
      if (expected == Outcome::kVolume && !(flags & kFlagBeyondCalibration)) {
        expect_near(made, reference);
      }
    }
  }

  void expect_refused(const std::string& name, const Weights& weights) const {
    EXPECT_THROWS(engine(ready(weights)), std::exception, "expected ") << name;
  }

  const Precision precision_ = GetParam().precision;
  const Weights weights_ = read_shipped_weights(GetParam().width);

 private:
  static SampleMessage converted(const Generator& generator, const std::vector<float>& frames,
                                 ImageSize size, StoredType type) {
    JobManifest manifest;
    manifest.sources.resize(1);
    manifest.output.dtype = type;
    const std::vector<std::unique_ptr<Dataset>> no_datasets;
    const SampleStages stages(manifest, no_datasets, generator, 1);
    PlannedShard shard{"s.h5", 0, size, {}};
    shard.samples.resize(1);
    SampleMessage message;
    message.shard = &shard;
    message.sample.sample_id = "case";
    message.prepared = {frames, size, 0, 0, {size, size, size, 0, 0}};
    stages.generate(message);
    stages.finish(message);
    message.shard = nullptr;
    return message;
  }

  /// What a reader of the shard gets: finite numbers >= 0, as near to the volume as the type is.
  static void expect_sound_chunk(const SampleMessage& message, const std::vector<float>& volume,
                                 StoredType type) {
    std::vector<float> read(volume.size());
    ASSERT_TRUE(decode_volume(message.chunk, type, JobManifest().output.deflate_level,
                              message.sample.scale, read));
    ASSERT_TRUE(std::ranges::all_of(read, [](float x) { return std::isfinite(x) && x >= 0; }));
    const float largest = std::ranges::max(volume);
    if (type == StoredType::kFloat32) {
      EXPECT_EQ(read, volume);
    } else if (largest <= kLargestHalf) {  // half a step of uint8 is the coarsest
      EXPECT_LE(testing::largest_difference(read, volume), 0.501f * largest / 255);
    } else {
      EXPECT_TRUE(type == StoredType::kUint8 ||
                  (message.sample.statistics.flags & kFlagSaturated) != 0);
    }
  }

  void expect_near(const std::vector<float>& volume, const std::vector<float>& reference) const {
    const float usual = std::ranges::max(
        testing::generated(*make_torch_generator(weights_), natural(kSize), kSize));
    const float largest = std::max(std::ranges::max(reference), usual);
    const float tolerance = precision_ == Precision::kFloat32    ? 1e-4f
                            : precision_ == Precision::kBfloat16 ? 0.1f
                                                                 : 0.15f;
    EXPECT_LE(testing::largest_difference(volume, reference), tolerance * largest);
  }
};

TEST_P(Extremes, Images) {
  const auto generator = engine(ready(weights_));
  const auto reference = make_torch_generator(weights_);
  for (const ImageCase& one : kImages) {
    const std::vector<float> frames = one.frames(one.size);
    expect_outcome(one.name, *generator, frames, one.size, Outcome::kVolume,
                   testing::generated(*reference, frames, one.size));
  }
}

TEST_P(Extremes, WeightsBeyondMeasure) {
  const std::vector<float> frames = natural(kSize);
  const auto reference = testing::generated(*make_torch_generator(weights_), frames, kSize);
  for (const WeightsCase& one : kWeights) {
    Weights weights = weights_;
    one.change(weights);
    const bool int8 = precision_ == Precision::kInt8;
    const Outcome expected = int8 ? one.in_int8 : one.in_floats;
    if (expected == Outcome::kRefused) {
      expect_refused(one.name, weights);
    } else {
      expect_outcome(one.name, *engine(ready(weights)), frames, kSize, expected, reference);
    }
  }
}

TEST_P(Extremes, CalibrationsThatDoNotFit) {
  if (precision_ != Precision::kInt8) GTEST_SKIP() << "needs none";
  const Weights fitting = ready(weights_);
  std::vector<float> volume(VolumeShape{weights_.bins, kSize}.value_count());
  EXPECT_LT(engine(fitting)->generate({natural(kSize), kSize}, volume).saturated_share,
            kMostSaturated)
      << "images like these";
  for (const CalibrationCase& one : kCalibrations) {
    Weights weights = fitting;
    const auto calibration = std::make_shared<Calibration>(*fitting.calibration);
    one.change(*calibration);
    weights.calibration = calibration;
    if (one.in_int8 == Outcome::kRefused) {
      EXPECT_THROWS(engine(weights), std::exception, "expected ") << one.name;
    } else {
      expect_outcome(one.name, *engine(weights), natural(kSize), kSize, one.in_int8, {});
    }
  }
}

/// Activations below float32's normal numbers are zero, whatever the last layer makes of them; and
/// the calling thread computes with such numbers as before.
TEST_P(Extremes, ActivationsThatUnderflowAreZero) {
  if (precision_ == Precision::kInt8) GTEST_SKIP() << "stores whole numbers";
  Weights weights = weights_;
  for (Convolution& each : weights.convolutions) std::ranges::fill(each.bias, 0.0f);
  // At most 2 x 9 products of 2^-98 and 2^-36: less than the smallest normal number, 2^-126.
  scale(layer(weights, "head").weight, -100);
  for (const float weight : layer(weights, "head").weight) ASSERT_LT(std::abs(weight), 0x1p-98f);
  scale(layer(weights, "pred").weight, 100);
  std::vector<float> frames = natural(kSize);
  scale(frames, -36);
  const std::vector<float> volume = testing::generated(*engine(weights), frames, kSize);
  EXPECT_EQ(std::ranges::count(volume, 0.0f), std::ssize(volume));
  volatile float smallest = std::numeric_limits<float>::denorm_min();
  EXPECT_GT(2 * smallest, smallest);
}

std::vector<EngineCase> all_engines() {
  std::vector<EngineCase> cases;
  for (const int width : shipped_widths()) {
    cases.push_back({Engine::kTorch, Precision::kFloat32, width});
    cases.push_back({Engine::kTorch, Precision::kBfloat16, width});
    cases.push_back({Engine::kOnednn, Precision::kFloat32, width});
    cases.push_back({Engine::kOnednn, Precision::kBfloat16, width});
    cases.push_back({Engine::kOnednn, Precision::kInt8, width});
  }
  return cases;
}

INSTANTIATE_TEST_SUITE_P(All, Extremes, ::testing::ValuesIn(all_engines()), [](const auto& one) {
  return std::string(to_string(one.param.engine)) + "_" +
         std::string(to_string(one.param.precision)) + "_" + std::to_string(one.param.width);
});

/// 4096x4096 pixels: 33.6 million values a frame, past what 32-bit byte offsets reach.
TEST(LargeImages, AreComputedAlikeByBothEngines) {
  if (!onednn_support(Precision::kFloat32).able) GTEST_SKIP() << "one engine alone";
  constexpr ImageSize kLarge{4096, 4096};
  const Weights weights = untrained_weights(4, 1, 5);
  const std::vector<float> frames = frames_of(kLarge, [](int frame, int y, int x) {
    return static_cast<double>((7 * (x + 2 * frame) + 13 * y + x * y) % 256);
  });
  const auto volume =
      testing::generated(*make_onednn_generator(weights, Precision::kFloat32), frames, kLarge);
  const auto expected = testing::generated(*make_torch_generator(weights), frames, kLarge);
  EXPECT_LE(testing::relative_error(volume, expected), 1e-5);
}

}  // namespace
}  // namespace eventgan
