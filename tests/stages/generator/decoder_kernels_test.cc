#include "stages/generator/decoder_kernels.h"

#include <gtest/gtest.h>

#include "manifests/counter_random.h"

namespace eventgan {
namespace {

constexpr int kOut = 2;
constexpr int kIn = 3;

std::vector<float> random_values(std::size_t count, std::uint64_t seed) {
  const CounterRandom random(seed);
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = float(random.uniform(i) * 2 - 1);
  return values;
}

/// Value of channel c at (y, x) of a picture [channel, y, x]; 0 beyond it.
double at(const std::vector<float>& picture, int height, int width, int c, int y, int x) {
  if (y < 0 || x < 0 || y >= height || x >= width) return 0;
  return picture[(static_cast<std::size_t>(c) * height + y) * width + x];
}

TEST(PhaseKernel, EqualsTheConvolutionOfTheDoubledPicture) {
  const int height = 4, width = 5;
  const auto kernel = random_values(kOut * kIn * 9, 1);
  const auto small = random_values(kIn * height * width, 2);
  const auto phases = phase_kernel(kernel, kOut, kIn);
  ASSERT_EQ(phases.size(), 4u * kOut * kIn * 4);

  for (int o = 0; o < kOut; ++o) {
    for (int y = 0; y < 2 * height; ++y) {
      for (int x = 0; x < 2 * width; ++x) {
        double direct = 0, phased = 0;
        for (int c = 0; c < kIn; ++c) {
          for (int t = 0; t < 9; ++t) {
            const int v = y + t / 3 - 1, u = x + t % 3 - 1;
            const bool inside = v >= 0 && u >= 0 && v < 2 * height && u < 2 * width;
            if (inside)
              direct += kernel[(o * kIn + c) * 9 + t] * at(small, height, width, c, v / 2, u / 2);
          }
          const int channel = (2 * (y % 2) + x % 2) * kOut + o;
          const int p = (y + 1) / 2, q = (x + 1) / 2;
          for (int t = 0; t < 4; ++t) {
            phased += phases[(channel * kIn + c) * 4 + t] *
                      at(small, height, width, c, p - 1 + t / 2, q - 1 + t % 2);
          }
        }
        EXPECT_NEAR(phased, direct, 1e-5) << o << " " << y << " " << x;
      }
    }
  }
}

TEST(DecoderKernels, SplitsTheInputChannels) {
  Convolution decoder{
      "decoders.3", kOut, kIn + kOut, 3, 1, random_values(kOut * (kIn + kOut) * 9, 3), {0, 0}};
  const DecoderKernels kernels = decoder_kernels(decoder);
  EXPECT_EQ(kernels.doubled_channels, kIn);
  ASSERT_EQ(kernels.doubled.size(), kOut * kIn * 9u);
  ASSERT_EQ(kernels.skip.size(), kOut * kOut * 9u);
  const auto weight = [&](int o, int c, int t) {
    return decoder.weight[(o * (kIn + kOut) + c) * 9 + t];
  };
  for (int o = 0; o < kOut; ++o) {
    for (int t = 0; t < 9; ++t) {
      for (int c = 0; c < kIn; ++c) {
        EXPECT_EQ(kernels.doubled[(o * kIn + c) * 9 + t], weight(o, c, t));
        EXPECT_EQ(kernels.transposed[(o * kIn + c) * 9 + t % 3 * 3 + t / 3], weight(o, c, t));
      }
      for (int c = 0; c < kOut; ++c) {
        EXPECT_EQ(kernels.skip[(o * kOut + c) * 9 + t], weight(o, kIn + c, t));
      }
    }
  }
}

}  // namespace
}  // namespace eventgan
