#include "stages/generator/onednn/winograd.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/layer_numbers.h"
#include "stages/generator/weights.h"
#include "tests/stages/generator/channel_images.h"

namespace eventgan {
namespace {

struct LayerCase {
  int in = 8;
  int out = 8;
  int stride = 1;
  bool doubled = false;  ///< a small image of twice the channels, beside it
  ImageSize size;
};

/// One layer's inputs and what it makes of them.
struct Layer {
  explicit Layer(const LayerCase& from, std::uint64_t seed = 1)
      : the(from),
        output_size(from.stride == 1 ? from.size : half_size(from.size)),
        plain(random_layer(from.out, from.in, 3, seed)),
        doubled(random_layer(from.out, 2 * from.in, 3, seed + 10)),
        input(random_image(from.size, from.in, seed + 20)),
        small(random_image(half_size(from.size), 2 * from.in, seed + 30)),
        convolution(plain, from.stride, kLeakySlope, from.doubled ? &doubled : nullptr) {}

  WinogradConvolution::Images images() const {
    return {input.data(), the.doubled ? small.data() : nullptr, the.size};
  }

  void run(int first, int end, float* output, int output_row, bool add) const {
    const PageBuffer buffer(convolution.buffer_bytes());
    std::memset(buffer.data(), 0xff, buffer.size_bytes());  // NaN, which nothing must see
    convolution.run(images(), first, end, output, output_row, add, buffer.data());
  }

  ChannelImage result(float before = 0, bool add = false) const {
    ChannelImage output(output_size, the.out, before);
    run(0, convolution.tile_rows(the.size), output.data(), 0, add);
    return output;
  }

  /// Plain loops. magnitude: the sum of the products' magnitudes.
  double expected(int y, int x, int channel, double before, double* magnitude = nullptr) const {
    double sum = plain.bias[channel] + before, all = std::abs(sum);
    const auto inside = [&](int row, int column) {
      return row >= 0 && column >= 0 && row < the.size.height && column < the.size.width;
    };
    for (int tap = 0; tap < 9; ++tap) {
      const int row = the.stride * y + tap / 3 - 1, column = the.stride * x + tap % 3 - 1;
      if (!inside(row, column)) continue;
      for (int i = 0; i < the.in; ++i) {
        const double product =
            double(plain.weight[(channel * the.in + i) * 9 + tap]) * input.at(row, column, i);
        sum += product, all += std::abs(product);
      }
      for (int i = 0; the.doubled && i < 2 * the.in; ++i) {
        const double product = double(doubled.weight[(channel * 2 * the.in + i) * 9 + tap]) *
                               small.at(row / 2, column / 2, i);
        sum += product, all += std::abs(product);
      }
    }
    if (magnitude) *magnitude = all;
    return sum > 0 ? sum : sum * kLeakySlope;
  }

  LayerCase the;
  ImageSize output_size;
  LayerNumbers plain, doubled;
  ChannelImage input, small;
  WinogradConvolution convolution;
};

std::string text_of(const LayerCase& one) {
  return std::to_string(one.in) + " to " + std::to_string(one.out) + ", stride " +
         std::to_string(one.stride) + (one.doubled ? ", doubled, " : ", ") + to_string(one.size);
}

std::vector<LayerCase> layer_cases() {
  constexpr ImageSize kSizes[] = {{1, 1}, {1, 2}, {2, 1}, {2, 2}, {3, 3},   {1, 37},
                                  {9, 1}, {4, 5}, {5, 4}, {7, 9}, {10, 64}, {17, 33}};
  std::vector<LayerCase> cases;
  for (const ImageSize size : kSizes) {
    for (const auto& [in, out] : {std::pair{8, 8}, {16, 16}, {8, 24}, {24, 8}, {40, 48}}) {
      cases.push_back({in, out, 1, false, size});
      cases.push_back({in, out, 1, true, size});
      cases.push_back({in, out, 2, false, size});
    }
  }
  return cases;
}

TEST(WinogradConvolution, EqualsThePlainOneOfEverySizeAndNumberOfChannels) {
  EVENTGAN_AVX2_OR_SKIP();
  for (const LayerCase& one : layer_cases()) {
    const Layer layer(one);
    for (const bool add : {false, true}) {
      const ChannelImage output = layer.result(0.75f, add);
      for (int y = 0; y < layer.output_size.height; ++y) {
        for (int x = 0; x < layer.output_size.width; ++x) {
          for (int channel = 0; channel < one.out; channel += 5) {  // of every lane some
            double magnitude = 0;
            const double expected = layer.expected(y, x, channel, add ? 0.75 : 0, &magnitude);
            // Sums of four inputs and weights of 9/4 taps round, too: more than the products alone.
            ASSERT_NEAR(output.at(y, x, channel), expected, 1e-6 * (magnitude + 9))
                << text_of(one) << " at " << y << ", " << x << ", " << channel;
          }
        }
      }
    }
  }
}

TEST(WinogradConvolution, OfSomeRowsOfTilesIsTheSameBitForBit) {
  EVENTGAN_AVX2_OR_SKIP();
  for (const LayerCase& one : {LayerCase{8, 8, 1, true, {13, 131}},
                               {16, 32, 2, false, {21, 95}},
                               {8, 16, 1, false, {6, 200}}}) {
    const Layer layer(one);
    const ChannelImage whole = layer.result();
    for (int tiles = 0; tiles < layer.convolution.tile_rows(one.size); ++tiles) {
      const int first = 2 * tiles - (one.doubled ? 1 : 0);
      const ChannelImage rows({2, layer.output_size.width}, one.out);
      layer.run(tiles, tiles + 1, rows.data(), first, false);
      for (int y = std::max(first, 0); y < std::min(first + 2, layer.output_size.height); ++y) {
        EXPECT_EQ(std::memcmp(&rows.at(y - first, 0, 0), &whole.at(y, 0, 0),
                              sizeof(float) * layer.output_size.width * one.out),
                  0)
            << text_of(one) << ", row " << y;
      }
    }
  }
}

TEST(WinogradConvolution, WhatIsNotFiniteReachesAllThatSeesItAlone) {
  EVENTGAN_AVX2_OR_SKIP();
  for (const LayerCase& one : {LayerCase{8, 8, 1, false, {9, 10}},
                               {8, 8, 1, true, {9, 9}},
                               {8, 16, 2, false, {9, 10}},
                               {8, 8, 1, true, {10, 8}}}) {
    for (const float bad : kBadNumbers) {
      for (const bool in_small : {false, true}) {
        if (in_small && !one.doubled) continue;
        const ImageSize size = in_small ? half_size(one.size) : one.size;
        for (const auto& [bad_y, bad_x] :
             {std::pair{0, 0}, {3, 2}, {size.height - 1, size.width - 1}}) {
          const Layer layer(one);
          (in_small ? layer.small : layer.input).at(bad_y, bad_x, 5) = bad;
          const ChannelImage output = layer.result();
          const auto sees = [&](int y, int x) {
            return y >= 0 && x >= 0 && y < layer.output_size.height &&
                   x < layer.output_size.width && !std::isfinite(layer.expected(y, x, 3, 0));
          };
          for (int y = 0; y < layer.output_size.height; ++y) {
            for (int x = 0; x < layer.output_size.width; ++x) {
              const bool finite = std::isfinite(output.at(y, x, 3));
              EXPECT_NE(sees(y, x), finite) << text_of(one) << " at " << y << ", " << x;
            }
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace eventgan
