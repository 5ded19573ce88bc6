#include "stages/generator/onednn/plane_layers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/layer_numbers.h"
#include "stages/generator/weights.h"
#include "tests/stages/generator/channel_images.h"

namespace eventgan {
namespace {

TEST(HeadConvolution, EqualsThePlainOneOfEverySize) {
  EVENTGAN_AVX2_OR_SKIP();
  for (const int in : {2, 3}) {
    for (const int out : {8, 24}) {
      const LayerNumbers head = random_layer(out, in, 3, 7);
      const HeadConvolution convolution(head);
      for (const ImageSize size :
           {ImageSize{1, 1}, {1, 2}, {2, 12}, {5, 13}, {7, 11}, {3, 50}, {40, 1}}) {
        const auto planes = random_numbers(in * size.pixel_count(), 3);
        const ChannelImage output(size, out);
        const PageBuffer buffer(convolution.buffer_bytes(size));
        std::memset(buffer.data(), 0xff, buffer.size_bytes());
        convolution.run(planes.data(), size, output.data(), buffer.data());
        for (int y = 0; y < size.height; ++y) {
          for (int x = 0; x < size.width; ++x) {
            for (int o = 0; o < out; ++o) {
              double sum = head.bias[o];
              for (int i = 0; i < in * 9; ++i) {
                const int row = y + i % 9 / 3 - 1, column = x + i % 3 - 1;
                if (row < 0 || column < 0 || row >= size.height || column >= size.width) continue;
                sum += double(head.weight[o * in * 9 + i]) *
                       planes[(i / 9 * size.height + row) * size.width + column];
              }
              ASSERT_NEAR(output.at(y, x, o), sum > 0 ? sum : sum * kLeakySlope, 1e-5)
                  << to_string(size) << " at " << y << ", " << x << ", " << o;
            }
          }
        }
      }
    }
  }
}

TEST(PlanePrediction, EqualsThePlainOneOfEveryWidth) {
  EVENTGAN_AVX2_OR_SKIP();
  constexpr float kUntouched = -7;
  for (const int in : {8, 24}) {
    for (const int out : {2, 18}) {
      const LayerNumbers pred = random_layer(out, in, 1, 9);
      const PlanePrediction prediction(pred);
      const PageBuffer buffer(prediction.buffer_bytes());
      for (const int width : {1, 8, 31, 32, 33, 100}) {
        const ChannelImage pixels = random_image({1, width + PlanePrediction::kPixels}, in, 4);
        const ImageSize size{3, width};
        std::vector<float> volume(out * size.pixel_count(), kUntouched);
        EXPECT_TRUE(prediction.run(pixels.data(), size, 1, 0, width, volume.data(), buffer.data()));
        for (std::size_t i = 0; i < volume.size(); ++i) {
          const int x = int(i) % width, o = int(i) / (3 * width);
          double sum = pred.bias[o];
          for (int c = 0; c < in; ++c) sum += double(pred.weight[o * in + c]) * pixels.at(0, x, c);
          const bool row = int(i) / width % 3 == 1;
          ASSERT_NEAR(volume[i], row ? std::max(sum, 0.0) : kUntouched, 1e-5) << width << " " << i;
        }
      }
    }
  }
}

TEST(PlanePrediction, KeepsNanAndSaysWhetherAllIsFinite) {
  EVENTGAN_AVX2_OR_SKIP();
  const ImageSize size{1, 50};
  const PlanePrediction prediction(random_layer(4, 8, 1, 9));
  const PageBuffer buffer(prediction.buffer_bytes());
  for (const float bad : kBadNumbers) {
    for (const int x : {0, 31, 32, 49}) {
      const ChannelImage pixels = random_image({1, size.width + PlanePrediction::kPixels}, 8, 4);
      pixels.at(0, x, 6) = bad;
      std::vector<float> volume(4 * size.pixel_count());
      EXPECT_FALSE(
          prediction.run(pixels.data(), size, 0, 0, size.width, volume.data(), buffer.data()))
          << x;
      for (std::size_t i = 0; i < volume.size(); ++i) {
        EXPECT_EQ(std::isnan(volume[i]), std::isnan(bad) && int(i % 50) == x) << i;
        EXPECT_FALSE(volume[i] < 0) << i;
      }
    }
  }
}

}  // namespace
}  // namespace eventgan
