#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <thread>
#include <vector>

#include "manifests/values/counter_random.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/stages/generator/plain_network.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"
#include "tests/testing/texts.h"

// What every engine must do in every precision that it has.

namespace eventgan {
namespace {

using testing::calibrated;
using testing::generated;
using testing::largest_difference;
using testing::natural_frames;
using testing::planes_of;
using testing::relative_error;

struct EngineCase {
  Engine engine = Engine::kTorch;
  Precision precision = Precision::kFloat32;
};

/// Largest relative L2 error of the whole volume against float32, and largest single difference in
/// units of the largest value.
struct Tolerance {
  double relative = 0;
  double largest = 0;
};

const std::map<Precision, Tolerance> kTolerances = {{Precision::kFloat32, {1e-5, 1e-4}},
                                                    {Precision::kBfloat16, {0.03, 0.1}},
                                                    {Precision::kInt8, {0.06, 0.15}}};

class Engines : public ::testing::TestWithParam<EngineCase> {
 protected:
  void SetUp() override {
    const bool torch = GetParam().engine == Engine::kTorch;
    if (torch && GetParam().precision == Precision::kFloat32) return;
    // LibTorch computes bfloat16 by oneDNN too.
    const OnednnSupport support = onednn_support(GetParam().precision);
    if (support.built ? !support.able : !torch) {
      GTEST_SKIP() << support.instruction_set << " does not compute "
                   << to_string(GetParam().precision);
    }
  }

  std::unique_ptr<Generator> engine(const Weights& weights) const {
    const Precision precision = GetParam().precision;
    if (GetParam().engine == Engine::kTorch) return make_torch_generator(weights, precision);
    return make_onednn_generator(
        precision == Precision::kInt8 ? calibrated(weights, {48, 64}) : weights, precision);
  }

  void expect_near(const std::vector<float>& volume, const std::vector<float>& expected,
                   const std::string& what) const {
    const Tolerance& tolerance = kTolerances.at(GetParam().precision);
    const float largest = *std::ranges::max_element(expected);
    ASSERT_GT(largest, 0.0f) << what;
    EXPECT_LE(relative_error(volume, expected), tolerance.relative) << what;
    EXPECT_LE(largest_difference(volume, expected), tolerance.largest * largest) << what;
  }
};

TEST_P(Engines, EqualsThePlainNetworkAtEverySize) {
  // The steps of int8 suit images like those it was calibrated on: a few pixels' values may be
  // small against them.
  const bool whole_numbers = GetParam().precision == Precision::kInt8;
  const ImageSize usual{48, 64};
  // Layers of width 8 have kernels of their own.
  for (const Weights& weights :
       {untrained_weights(2, 3, 5), untrained_weights(8, 3, 5),
        testing::untrained_sensor_weights(3, 3, 5), testing::untrained_sensor_weights(8, 3, 5)}) {
    const auto generator = engine(weights);
    EXPECT_EQ(generator->thresholds(), weights.thresholds);
    const auto expected_of = [&](const std::vector<float>& frames, ImageSize size) {
      return testing::plain_network(weights, planes_of(weights, frames, size), size);
    };
    const float usual_largest = std::ranges::max(expected_of(natural_frames(usual, 11), usual));
    for (const ImageSize size :
         {ImageSize{16, 32}, ImageSize{17, 23}, ImageSize{1, 1}, ImageSize{1, 37}, ImageSize{33, 1},
          ImageSize{31, 18}, ImageSize{2, 2}, ImageSize{3, 50}, ImageSize{18, 31}, ImageSize{4, 64},
          ImageSize{5, 95}, ImageSize{2, 97}}) {
      const auto frames = natural_frames(size, 11);
      const auto volume = generated(*generator, frames, size);
      const auto expected = expected_of(frames, size);
      const std::string what = to_string(size) + ", width " +
                               std::to_string(weights.base_channels) + ", " +
                               std::to_string(weights.inputs()) + " inputs";
      if (whole_numbers) {
        EXPECT_LE(largest_difference(volume, expected), 0.1f * usual_largest) << what;
      } else {
        expect_near(volume, expected, what);
      }
    }
  }
}

/// The small network of published/make_published.py, so that one is compared on every machine.
TEST_P(Engines, EqualsTheSmallPublishedNetwork) {
  const std::filesystem::path folder =
      std::filesystem::path(EVENTGAN_SOURCE_DIR) / "tests/stages/generator/published";
  const auto generator =
      engine(fold_generator(read_checkpoint(folder / "published.pt", "gen"), ""));
  const StateDict numbers = read_checkpoint(folder / "published_case.pt", "case");
  const NamedTensor& input = numbers.at("input");
  const ImageSize size{int(input.shape[1]), int(input.shape[2])};
  expect_near(generated(*generator, input.values, size), numbers.at("volume").values, "published");
}

TEST_P(Engines, EqualsThePublishedNetworkWhateverRanBefore) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const auto checkpoint = data / "golden" / "checkpoint_zip.pt";
  const auto generator =
      engine(fold_generator(read_checkpoint(checkpoint, "gen"), checkpoint.string()));
  int cases = 0;
  for (int round = 0; round < 2; ++round) {
    for (const std::string& name : testing::member_names(golden, "generator")) {
      if (name == "state") continue;
      const auto input = testing::read_array(golden, "generator/" + name + "/input");
      const ImageSize size{int(input.shape[1]), int(input.shape[2])};
      expect_near(generated(*generator, input.values, size),
                  testing::read_array(golden, "generator/" + name + "/volume").values, name);
      ++cases;
    }
  }
  EXPECT_EQ(cases, 6);
}

/// A sixth of an image's rows and columns of tiles at a place drawn by the seed; for even seeds
/// its last tile too.
TileMask some_tiles(ImageSize size, int origin_y, int origin_x, std::uint64_t seed) {
  TileMask mask{size, 16, origin_y, origin_x, {}};
  mask.wanted.assign(static_cast<std::size_t>(mask.rows()) * mask.columns(), 0);
  const CounterRandom random(seed);
  const int rows = (mask.rows() + 5) / 6, columns = (mask.columns() + 5) / 6;
  const int top = int(random.uniform(0) * (mask.rows() - rows + 1));
  const int left = int(random.uniform(1) * (mask.columns() - columns + 1));
  for (int row = top; row < top + rows; ++row) {
    std::fill_n(mask.wanted.begin() + row * mask.columns() + left, columns, std::uint8_t{1});
  }
  if (seed % 2 == 0) mask.wanted.back() = 1;
  return mask;
}

TEST_P(Engines, GivesTheTilesThatAreWantedAndZerosElsewhere) {
  const std::map<Precision, float> largest = {
      {Precision::kFloat32, 1e-5f}, {Precision::kBfloat16, 0.02f}, {Precision::kInt8, 1e-5f}};
  std::uint64_t seed = 0;
  for (const Weights& weights : {untrained_weights(4, 3, 5), untrained_weights(8, 3, 5),
                                 testing::untrained_sensor_weights(8, 3, 5)}) {
    const auto generator = engine(weights);
    for (const ImageSize size : {ImageSize{320, 480}, ImageSize{255, 401}, ImageSize{64, 700},
                                 ImageSize{49, 33}, ImageSize{1, 37}, ImageSize{5, 1}}) {
      for (const int origin : {0, 5}) {
        const TileMask wanted = some_tiles(size, origin, 15 - origin, seed++);
        const auto frames = natural_frames(size, 11);
        std::vector<float> expected = generated(*generator, frames, size);
        clear_unwanted(wanted, expected);
        std::vector<float> volume(expected.size(), -1.0f);
        const GenerationNotes notes =
            generator->generate_tiles({frames, wanted.size}, wanted, volume);
        EXPECT_EQ(notes.sound, GetParam().engine == Engine::kOnednn);
        const bool exact = generator->description().find("Winograd layers") != std::string::npos;
        EXPECT_LE(largest_difference(volume, expected),
                  exact ? 0 : largest.at(GetParam().precision) * std::ranges::max(expected))
            << to_string(size) << " " << origin << ", width " << weights.base_channels << ", "
            << weights.inputs() << " inputs";
        for (std::size_t i = 0; i < volume.size(); ++i) ASSERT_GE(volume[i], 0.0f) << i;
      }
    }
  }
}

TEST_P(Engines, IsToldAThreshold) {
  const ImageSize small{33, 46}, large{97, 130};
  TileMask wanted{large, 16, 0, 0, {}};
  wanted.wanted.assign(static_cast<std::size_t>(wanted.rows()) * wanted.columns(), 0);
  wanted.wanted[9] = 1;
  for (const int base_channels : {4, 8}) {
    const Weights weights = testing::untrained_sensor_weights(base_channels, 3, 5);
    const auto generator = engine(weights);
    const auto told = [&](ImageSize size, std::optional<ContrastThreshold> threshold) {
      std::vector<float> volume(2 * 3 * size.pixel_count(), -1.0f);
      generator->generate({natural_frames(size, 11), size, threshold}, volume);
      return volume;
    };
    const auto middle = told(small, std::nullopt);
    EXPECT_EQ(told(small, ContrastThreshold{weights.thresholds->geometric_mean()}), middle);
    for (const ContrastThreshold threshold : {ContrastThreshold{0.1}, {0.35, 2}, {0.35, 0.5}}) {
      const auto volume = told(small, threshold);
      EXPECT_NE(volume, middle);
      const auto planes = sensor_input(natural_frames(small, 11), threshold);
      expect_near(volume, testing::plain_network(weights, planes, small), "told");
    }
    const ContrastThreshold threshold{0.1, 2};
    std::vector<float> expected = told(large, threshold), tiles(expected.size(), -1.0f);
    clear_unwanted(wanted, expected);
    generator->generate_tiles({natural_frames(large, 11), large, threshold}, wanted, tiles);
    EXPECT_LE(largest_difference(tiles, expected), 0.02f * std::ranges::max(expected));
  }
}

TEST_P(Engines, RefusesAThresholdThatItDoesNotKnow) {
  const ImageSize size{40, 50};
  const auto frames = natural_frames(size, 1);
  std::vector<float> volume(2 * 3 * size.pixel_count());
  TileMask wanted{size, 16, 0, 0, std::vector<std::uint8_t>(3 * 4)};
  wanted.wanted[0] = 1;
  const auto two = engine(untrained_weights(2, 3, 5));
  const auto three = engine(testing::untrained_sensor_weights(2, 3, 5));
  EXPECT_EQ(two->thresholds(), std::nullopt);
  EXPECT_THROWS(two->generate({frames, size, ContrastThreshold{0.2}}, volume),
                std::invalid_argument, "expected none for these weights, got a contrast threshold");
  EXPECT_THROWS(two->generate_tiles({frames, size, ContrastThreshold{0.2}}, wanted, volume),
                std::invalid_argument, "expected none for these weights, got a contrast threshold");
  EXPECT_THROWS(three->generate({frames, size, ContrastThreshold{0}}, volume),
                std::invalid_argument, "expected a contrast threshold above 0 for these weights");
}

TEST_P(Engines, GivesZerosIfNothingIsWanted) {
  const auto generator = engine(untrained_weights(2, 3, 5));
  const TileMask nothing{{17, 40}, 16, 0, 0, std::vector<std::uint8_t>(2 * 3)};
  std::vector<float> volume(2 * 3 * nothing.size.pixel_count(), -1.0f);
  generator->generate_tiles({natural_frames(nothing.size, 1), nothing.size}, nothing, volume);
  EXPECT_EQ(volume, std::vector<float>(volume.size(), 0.0f));
  volume.pop_back();
  EXPECT_THROWS(
      generator->generate_tiles({natural_frames(nothing.size, 1), nothing.size}, nothing, volume),
      std::invalid_argument, "expected frames [2, H, W] and a volume [6, H, W] of 40x17");
}

TEST_P(Engines, EqualsTheReferenceWithShippedWeightsAtTheUsualSize) {
  const Weights weights = read_shipped_weights(default_shipped_width());
  const ImageSize size{260, 861};
  const auto frames = natural_frames(size, 3);
  expect_near(generated(*engine(weights), frames, size),
              generated(*make_torch_generator(weights), frames, size), "shipped");
}

TEST_P(Engines, DependsOnItsFramesAlone) {
  const Weights weights = untrained_weights(8, 9, 1);
  const auto generator = engine(weights);
  const ImageSize size{37, 45};
  const auto frames = natural_frames(size, 1);
  const auto first = generated(*generator, frames, size);
  generated(*generator, natural_frames({64, 64}, 2), {64, 64});
  EXPECT_EQ(generated(*generator, frames, size), first);

  std::vector<std::vector<float>> volumes(4);
  std::vector<std::jthread> threads;
  for (auto& volume : volumes) {
    threads.emplace_back([&] {
      for (int round = 0; round < 5; ++round) volume = generated(*generator, frames, size);
    });
  }
  threads.clear();
  for (const auto& volume : volumes) EXPECT_EQ(volume, first);
  EXPECT_EQ(generated(*engine(weights), frames, size), first)
      << "another engine of the same weights";
}

TEST_P(Engines, IsTheSameWhateverTheCallersOpenmpSettingIs) {
  const Weights weights = untrained_weights(4, 9, 1);
  const ImageSize size{70, 90};
  const auto frames = natural_frames(size, 1);
  const auto expected = generated(*engine(weights), frames, size);
  for (const int threads : {1, 2, 5}) {
    const auto generator = engine(weights);  // so that its plan is built under the setting, too
    std::vector<float> volume;
    std::jthread([&] {
      omp_set_num_threads(threads);
      volume = generated(*generator, frames, size);
      // LibTorch keeps the one thread, of this thread alone; oneDNN's engine gives back what was
      // set.
      EXPECT_EQ(omp_get_max_threads(), GetParam().engine == Engine::kOnednn ? threads : 1);
    }).join();
    EXPECT_EQ(volume, expected) << threads;
  }
}

TEST_P(Engines, LosesNoNan) {
  const ImageSize size{20, 21};
  for (const Weights& weights :
       {untrained_weights(4, 9, 1), untrained_weights(8, 9, 1),
        testing::untrained_sensor_weights(4, 9, 1), testing::untrained_sensor_weights(8, 9, 1)}) {
    const auto generator = engine(weights);
    for (const float bad :
         {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
      auto frames = natural_frames(size, 1);
      frames[200] = bad;
      std::vector<float> volume(18 * size.pixel_count());
      const GenerationNotes notes = generator->generate({frames, size}, volume);
      EXPECT_TRUE(std::ranges::any_of(volume, [](float value) { return !std::isfinite(value); }));
      EXPECT_FALSE(notes.sound);
    }
  }
}

TEST_P(Engines, SeesInfinityInAnyChannelAndAtAnyPixel) {
  constexpr int kBins = 3;
  for (const int base_channels : {4, 8}) {
    // The last of them, as it is, and each of the others with a channel that overflows in places.
    for (int channel = 0; channel <= 2 * kBins; ++channel) {
      Weights weights = untrained_weights(base_channels, kBins, 5);
      Convolution& pred = weights.convolutions.back();
      ASSERT_EQ(pred.name, "pred");
      if (channel < 2 * kBins) {
        pred.bias[channel] = std::numeric_limits<float>::max();
        pred.weight[channel * base_channels] = 1e38f;
      }
      std::unique_ptr<Generator> generator;
      try {
        generator = engine(weights);
      } catch (const std::invalid_argument&) {
        EXPECT_EQ(GetParam().precision, Precision::kInt8);  // 8 bits cannot serve such numbers
        continue;
      }
      int overflowed = 0;
      for (const ImageSize size : {ImageSize{1, 1}, ImageSize{1, 37}, ImageSize{5, 95},
                                   ImageSize{33, 1}, ImageSize{9, 64}}) {
        std::vector<float> volume(2 * kBins * size.pixel_count());
        const GenerationNotes notes = generator->generate({natural_frames(size, 11), size}, volume);
        overflowed += !all_finite(volume);
        EXPECT_EQ(notes.sound, GetParam().engine == Engine::kOnednn && all_finite(volume))
            << to_string(size) << ", channel " << channel << ", width " << base_channels;
      }
      EXPECT_EQ(overflowed > 0, channel < 2 * kBins) << channel;
    }
  }
}

TEST_P(Engines, RefusesSpansOfOtherSizes) {
  const auto generator = engine(untrained_weights(2, 9, 1));
  std::vector<float> frames(2 * 6), volume(18 * 6);
  EXPECT_THROWS(generator->generate({frames, {3, 3}}, volume), std::invalid_argument,
                "expected frames [2, H, W] and a volume [18, H, W] of 3x3");
  EXPECT_THROWS(generator->generate({frames, {0, 0}}, volume), std::invalid_argument,
                "expected frames [2, H, W] and a volume [18, H, W] of 0x0");
  volume.pop_back();
  EXPECT_THROWS(generator->generate({frames, {2, 3}}, volume), std::invalid_argument,
                "expected frames [2, H, W] and a volume [18, H, W] of 3x2");
}

INSTANTIATE_TEST_SUITE_P(All, Engines,
                         ::testing::Values(EngineCase{Engine::kTorch, Precision::kFloat32},
                                           EngineCase{Engine::kTorch, Precision::kBfloat16},
                                           EngineCase{Engine::kOnednn, Precision::kFloat32},
                                           EngineCase{Engine::kOnednn, Precision::kBfloat16},
                                           EngineCase{Engine::kOnednn, Precision::kInt8}),
                         [](const auto& one) {
                           return std::string(to_string(one.param.engine)) + "_" +
                                  std::string(to_string(one.param.precision));
                         });

}  // namespace
}  // namespace eventgan
