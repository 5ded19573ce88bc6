#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <thread>

#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/torch/torch_generator.h"
#include "tests/stages/generator/engine_trials.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using testing::generated;
using testing::largest_difference;
using testing::natural_frames;

/// On the CPU always, and on CUDA where there is one.
class BatchedGenerator : public ::testing::TestWithParam<Device> {
 protected:
  void SetUp() override {
    const std::string lack = cuda_support(Precision::kFloat32).lack;
    if (GetParam() == Device::kCuda && !lack.empty()) GTEST_SKIP() << lack;
  }

  static std::unique_ptr<Generator> make(const Weights& weights,
                                         Precision precision = Precision::kFloat32) {
    return make_batched_generator(weights, precision, GetParam());
  }

  /// The volumes of so many pairs, asked for by a thread each at the same time.
  static std::vector<std::vector<float>> at_once(const Generator& generator, int pairs,
                                                 ImageSize size) {
    std::vector<std::vector<float>> volumes(std::size_t(pairs), std::vector<float>{});
    std::vector<std::jthread> threads;
    for (int i = 0; i < pairs; ++i) {
      threads.emplace_back([&, i] {
        volumes[std::size_t(i)] = generated(generator, natural_frames(size, i), size);
      });
    }
    return threads.clear(), volumes;
  }
};

TEST_P(BatchedGenerator, EqualsTheReferenceOfEachPairAlone) {
  const Weights weights = untrained_weights(4, 3, 5);
  const auto reference = make_torch_generator(weights);
  const auto generator = make(weights);
  const float largest = GetParam() == Device::kCpu ? 1e-5f : 1e-4f;  // of the volume's largest
  // Odd sizes have a last row and column of their own.
  for (const ImageSize size : {ImageSize{33, 46}, ImageSize{48, 64}, ImageSize{1, 37}}) {
    const auto volumes = at_once(*generator, 7, size);
    for (int i = 0; i < 7; ++i) {
      const auto expected = generated(*reference, natural_frames(size, i), size);
      EXPECT_LE(largest_difference(volumes[std::size_t(i)], expected),
                largest * std::ranges::max(expected))
          << to_string(size) << " " << i;
    }
  }
}

TEST_P(BatchedGenerator, TellsEachPairItsThreshold) {
  const Weights weights = testing::untrained_sensor_weights(4, 3, 5);
  const auto reference = make_torch_generator(weights);
  const auto generator = make(weights);
  EXPECT_EQ(generator->thresholds(), weights.thresholds);
  const ImageSize size{33, 46};
  const auto frames = natural_frames(size, 1);
  const auto volume_of = [&](const Generator& asked, double threshold) {
    std::vector<float> volume(6 * size.pixel_count(), -1.0f);
    asked.generate({frames, size, ContrastThreshold{threshold}}, volume);
    return volume;
  };
  std::vector<std::jthread> threads;
  for (int i = 0; i < 5; ++i) {
    threads.emplace_back([&, threshold = 0.1 + 0.05 * i] {
      const auto expected = volume_of(*reference, threshold);
      EXPECT_LE(largest_difference(volume_of(*generator, threshold), expected),
                1e-4f * std::ranges::max(expected));
    });
  }
  threads.clear();
  EXPECT_THROWS(volume_of(*make(untrained_weights(4, 3, 5)), 0.2), std::invalid_argument,
                "expected none for these weights, got a contrast threshold");
}

TEST_P(BatchedGenerator, GivesTheSameBytesWhateverElseIsInTheBatch) {
  const auto generator = make(untrained_weights(4, 3, 5));
  const ImageSize size{33, 46};
  std::vector<std::vector<float>> alone;
  for (int i = 0; i < 9; ++i) alone.push_back(generated(*generator, natural_frames(size, i), size));
  for (int round = 0; round < 5; ++round) EXPECT_EQ(at_once(*generator, 9, size), alone);
}

TEST_P(BatchedGenerator, ComputesBfloat16WithItsError) {
  const OnednnSupport processor = onednn_support(Precision::kBfloat16);
  if (GetParam() == Device::kCpu && processor.built && !processor.able) {
    GTEST_SKIP() << processor.instruction_set << " does not compute bfloat16";
  }
  const Weights weights = untrained_weights(4, 3, 5);
  const auto frames = natural_frames({33, 46}, 1);
  const auto expected = generated(*make_torch_generator(weights), frames, {33, 46});
  EXPECT_LE(testing::relative_error(
                generated(*make(weights, Precision::kBfloat16), frames, {33, 46}), expected),
            0.03);
}

TEST_P(BatchedGenerator, KeepsANanToItsPair) {
  const auto generator = make(untrained_weights(2, 3, 5));
  const ImageSize size{33, 46};
  const auto sound = generated(*generator, natural_frames(size, 1), size);
  auto frames = natural_frames(size, 2);
  frames[200] = std::numeric_limits<float>::quiet_NaN();
  for (int round = 0; round < 5; ++round) {
    std::jthread bad([&] {
      const auto volume = generated(*generator, frames, size);
      EXPECT_TRUE(std::ranges::any_of(volume, [](float value) { return std::isnan(value); }));
    });
    EXPECT_EQ(generated(*generator, natural_frames(size, 1), size), sound);
  }
}

TEST_P(BatchedGenerator, ClearsTheTilesThatAreNotWanted) {
  const auto generator = make(untrained_weights(2, 3, 5));
  const ImageSize size{33, 46};
  TileMask wanted{size, 16, 0, 0, std::vector<std::uint8_t>(3 * 3)};
  wanted.wanted[4] = 1;
  const auto frames = natural_frames(size, 1);
  auto expected = generated(*generator, frames, size);
  clear_unwanted(wanted, expected);
  std::vector<float> volume(expected.size(), -1.0f);
  generator->generate_tiles({frames, wanted.size}, wanted, volume);
  EXPECT_EQ(volume, expected);
}

TEST_P(BatchedGenerator, SaysWhatItIsAndRefusesWhatItIsNot) {
  const auto generator = make(untrained_weights(2, 3, 5));
  EXPECT_EQ(generator->bins(), 3);
  // Two batches of as many as have 2^21 pixels together, 1 to 16.
  EXPECT_EQ(generator->device_calls({260, 861}), 2 * 9);
  EXPECT_EQ(generator->device_calls({64, 64}), 2 * 16);
  EXPECT_EQ(generator->device_calls({0, 0}), 2 * 16);
  EXPECT_EQ(generator->device_calls({8192, 8192}), 2);
  // Frames [2, y, x] there, a volume [6, y, x] back.
  EXPECT_EQ(generator->working_bytes({10, 10}), (2 + 6) * 100 * sizeof(float));
  EXPECT_THAT(generator->description(),
              ::testing::StartsWith(GetParam() == Device::kCuda ? "torch float32 on cuda: "
                                                                : "torch float32 on cpu, "));
  std::vector<float> frames(2 * 6), volume(6 * 5);
  EXPECT_THROWS(generator->generate({frames, {2, 3}}, volume), std::invalid_argument,
                "expected frames [2, H, W] and a volume [6, H, W] of 3x2");
  EXPECT_THROWS(make(untrained_weights(2, 3, 5), Precision::kInt8), std::invalid_argument,
                "expected float32 or bfloat16 for LibTorch, got int8");
}

INSTANTIATE_TEST_SUITE_P(Devices, BatchedGenerator, ::testing::Values(Device::kCpu, Device::kCuda),
                         [](const auto& one) { return std::string(to_string(one.param)); });

TEST(CudaSupport, SaysWhatIsMissingOrWhatThereIs) {
  const CudaSupport support = cuda_support(Precision::kFloat32);
  if (support.lack.empty()) {
    EXPECT_THAT(support.device, ::testing::MatchesRegex("cuda: .+ \\(compute capability .+\\)"));
    return;
  }
  EXPECT_EQ(support.device, "");
  EXPECT_THAT(support.lack,
              ::testing::AnyOf("LibTorch was built without CUDA", "LibTorch finds no CUDA device"));
  EXPECT_THROWS(
      make_batched_generator(untrained_weights(1, 1, 1), Precision::kFloat32, Device::kCuda),
      std::runtime_error, "expected a CUDA device for float32, got none: LibTorch was");
}

}  // namespace
}  // namespace eventgan
