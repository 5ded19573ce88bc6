#include "stages/generator/torch/torch_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>
#include <vector>

#include "manifests/counter_random.h"
#include "stages/generator/checkpoints/checkpoint.h"
#include "stages/generator/checkpoints/fold.h"
#include "stages/generator/untrained.h"
#include "tests/stages/generator/plain_network.h"
#include "tests/testing/golden_numbers.h"
#include "tests/testing/shared_data.h"

namespace eventgan {
namespace {

std::vector<float> random_frames(ImageSize size, std::uint64_t seed) {
  const CounterRandom random(seed);
  std::vector<float> frames(2 * size.pixel_count());
  for (std::size_t i = 0; i < frames.size(); ++i) frames[i] = float(random.uniform(i) * 2 - 1);
  return frames;
}

std::vector<float> generate(const Generator& generator, const std::vector<float>& frames,
                            ImageSize size) {
  std::vector<float> volume(2 * generator.bins() * size.pixel_count(), -1.0f);
  generator.generate(frames, size, volume);
  return volume;
}

float largest_difference(const std::vector<float>& a, const std::vector<float>& b) {
  float largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, std::abs(a[i] - b[i]));
  return largest;
}

class TorchGeneratorSizes : public ::testing::TestWithParam<ImageSize> {};

TEST_P(TorchGeneratorSizes, EqualsThePlainNetwork) {
  const Weights weights = untrained_weights(2, 3, 5);
  const auto generator = make_torch_generator(weights);
  const auto frames = random_frames(GetParam(), 11);
  const auto expected = testing::plain_network(weights, frames, GetParam());
  const auto volume = generate(*generator, frames, GetParam());
  const float largest = *std::max_element(expected.begin(), expected.end());
  ASSERT_GT(largest, 0.0f);
  EXPECT_LE(largest_difference(volume, expected), 1e-5f * largest);
}

INSTANTIATE_TEST_SUITE_P(OddEvenAndSmallest, TorchGeneratorSizes,
                         ::testing::Values(ImageSize{16, 32}, ImageSize{17, 23}, ImageSize{1, 1},
                                           ImageSize{1, 37}, ImageSize{33, 1}, ImageSize{31, 18}),
                         [](const auto& size) {
                           return std::to_string(size.param.width) + "x" +
                                  std::to_string(size.param.height);
                         });

TEST(TorchGenerator, DependsOnItsFramesAlone) {
  const auto generator = make_torch_generator(untrained_weights(4, 9, 1));
  const ImageSize size{20, 30};
  const auto frames = random_frames(size, 1);
  const auto first = generate(*generator, frames, size);
  generate(*generator, random_frames({9, 7}, 2), {9, 7});
  EXPECT_EQ(generate(*generator, frames, size), first);
  std::vector<float> from_thread;
  std::thread([&] { from_thread = generate(*generator, frames, size); }).join();
  EXPECT_EQ(from_thread, first);
}

TEST(TorchGenerator, RefusesSpansOfOtherSizes) {
  const auto generator = make_torch_generator(untrained_weights(2, 9, 1));
  std::vector<float> frames(2 * 6), volume(18 * 6);
  EXPECT_THROW(generator->generate(frames, {3, 3}, volume), std::invalid_argument);
  EXPECT_THROW(generator->generate(frames, {0, 0}, volume), std::invalid_argument);
  volume.pop_back();
  EXPECT_THROW(generator->generate(frames, {2, 3}, volume), std::invalid_argument);
}

TEST(TorchGenerator, EqualsThePublishedNetworkWhateverRanBefore) {
  EVENTGAN_SHARED_DATA_OR_SKIP(data);
  const auto golden = data / "golden" / "golden.h5";
  const auto checkpoint = data / "golden" / "checkpoint_zip.pt";
  const auto generator =
      make_torch_generator(fold_generator(read_checkpoint(checkpoint, "gen"), checkpoint.string()));
  int cases = 0;
  for (int round = 0; round < 2; ++round) {
    for (const std::string& name : testing::member_names(golden, "generator")) {
      if (name == "state") continue;
      const auto input = testing::read_array(golden, "generator/" + name + "/input");
      const auto expected = testing::read_array(golden, "generator/" + name + "/volume").values;
      const ImageSize size{int(input.shape[1]), int(input.shape[2])};
      const auto volume = generate(*generator, input.values, size);
      const float largest = *std::max_element(expected.begin(), expected.end());
      EXPECT_LE(largest_difference(volume, expected), 1e-4f * largest) << name;
      ++cases;
    }
  }
  EXPECT_EQ(cases, 6);
}

}  // namespace
}  // namespace eventgan
