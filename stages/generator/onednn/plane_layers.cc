#include "stages/generator/onednn/plane_layers.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>

#include "stages/generator/weights.h"

namespace eventgan {
namespace {

using EightBits = std::uint32_t __attribute__((vector_size(kEight * sizeof(float))));
/// Eight values anywhere in memory.
using EightInMemory =
    float __attribute__((vector_size(kEight * sizeof(float)), aligned(alignof(float)), may_alias));

constexpr int kHeadPixels = 12;

/// From a row of a plane to the next: a zero before its first pixel and one behind its last, and
/// what is read of pixels that nobody needs.
std::ptrdiff_t head_pitch(int width) { return width + 2 + kHeadPixels; }

}  // namespace

HeadConvolution::HeadConvolution(const LayerNumbers& head)
    : in_(head.in_channels),
      out_(head.out_channels),
      weights_(static_cast<std::size_t>(out_) * in_ * 9 / kEight),
      bias_(out_ / kEight) {
  for (int o = 0; o < out_; ++o) {
    if (!head.bias.empty()) bias_[o / kEight].values[o % kEight] = head.bias[o];
    for (int i = 0; i < in_; ++i) {
      for (int tap = 0; tap < 9; ++tap) {
        weights_[((o / kEight * 3 + tap / 3) * in_ + i) * 3 + tap % 3].values[o % kEight] =
            head.weight[(static_cast<std::size_t>(o) * in_ + i) * 9 + tap];
      }
    }
  }
}

std::size_t HeadConvolution::buffer_bytes(ImageSize size) const {
  return sizeof(float) * 3 * in_ * head_pitch(size.width);
}

EVENTGAN_AVX2
void HeadConvolution::run(const float* inputs, ImageSize size, float* output,
                          std::byte* buffer) const {
  auto* const rows = reinterpret_cast<float*>(buffer);
  std::memset(buffer, 0, buffer_bytes(size));
  const std::ptrdiff_t pitch = head_pitch(size.width);
  for (int y = 0; y < size.height; ++y) {
    for (int row = y == 0 ? 0 : y + 1; row < std::min(y + 2, size.height); ++row) {
      for (int plane = 0; plane < in_; ++plane) {
        std::memcpy(rows + (row % 3 * in_ + plane) * pitch + 1,
                    inputs + (static_cast<std::ptrdiff_t>(plane) * size.height + row) * size.width,
                    size.width * sizeof(float));
      }
    }
    for (int x = 0; x < size.width; x += kHeadPixels) {
      const int pixels = std::min(kHeadPixels, size.width - x);
      for (int eights = 0; eights < out_ / kEight; ++eights) {
        Eight sums[kHeadPixels];
#pragma GCC unroll 12
        for (Eight& sum : sums) sum = eight(bias_[eights].values);
        for (int row = std::max(y - 1, 0); row < std::min(y + 2, size.height); ++row) {
          const float* plane = rows + row % 3 * in_ * pitch + x;
          const EightWeights* weights = &weights_[(eights * 3 + row - y + 1) * in_ * 3];
          for (int i = 0; i < in_; ++i, plane += pitch) {
#pragma GCC unroll 3
            for (int column = 0; column < 3; ++column, ++weights) {
              const Eight weight = eight(weights->values);
#pragma GCC unroll 12
              for (int p = 0; p < kHeadPixels; ++p) sums[p] += weight * plane[column + p];
            }
          }
        }
        float* to =
            output + (static_cast<std::ptrdiff_t>(y) * size.width + x) * out_ + eights * kEight;
#pragma GCC unroll 12
        for (int p = 0; p < kHeadPixels; ++p) {
          if (p < pixels) keep(sums[p] > 0 ? sums[p] : sums[p] * kLeakySlope, to + p * out_);
        }
      }
    }
  }
}

PlanePrediction::PlanePrediction(const LayerNumbers& pred)
    : in_(pred.in_channels), out_(pred.out_channels), weights_(pred.weight), bias_(pred.bias) {
  bias_.resize(out_);
}

std::size_t PlanePrediction::buffer_bytes() const { return sizeof(float) * kPixels * in_; }

namespace {

/// 8 pixels of [x, channel] become [channel, x].
EVENTGAN_EIGHT_INLINE void transpose(Eight (&pixels)[kEight]) {
  Eight pairs[kEight], fours[kEight];
#pragma GCC unroll 4
  for (int i = 0; i < kEight; i += 2) {
    const Eight a = pixels[i], b = pixels[i + 1];
    pairs[i] = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
    pairs[i + 1] = __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
  }
#pragma GCC unroll 4
  for (int i = 0; i < kEight / 2; ++i) {
    const int from = i / 2 * 4 + i % 2;
    const Eight a = pairs[from], b = pairs[from + 2];
    fours[i / 2 * 4 + i % 2 * 2] = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13);
    fours[i / 2 * 4 + i % 2 * 2 + 1] = __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  }
#pragma GCC unroll 4
  for (int i = 0; i < kEight / 2; ++i) {
    const Eight a = fours[i], b = fours[i + 4];
    pixels[i] = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
    pixels[i + 4] = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
  }
}

}  // namespace

EVENTGAN_AVX2
bool PlanePrediction::run(const float* pixels, ImageSize size, int y, int first_x, int end_x,
                          float* volume, std::byte* buffer) const {
  constexpr int kVectors = kPixels / kEight, kPlanes = 2;
  auto* const channels = reinterpret_cast<float*>(buffer);
  const auto plane_values = static_cast<std::ptrdiff_t>(size.pixel_count());
  EightBits largest{};
  for (int x = first_x; x < end_x; x += kPixels, pixels += kPixels * in_) {
    const int count = std::min(kPixels, end_x - x);
    EightBits magnitudes[kVectors];  // of numbers; of what lies behind the last pixel nothing
    for (int p = 0; p < kPixels; ++p)
      magnitudes[p / kEight][p % kEight] = p < count ? 0x7fffffff : 0;
    for (int i = 0; i < in_; i += kEight) {
#pragma GCC unroll 4
      for (int v = 0; v < kVectors; ++v) {
        Eight lanes[kEight];
#pragma GCC unroll 8
        for (int p = 0; p < kEight; ++p) lanes[p] = eight(pixels + (v * kEight + p) * in_ + i);
        transpose(lanes);
#pragma GCC unroll 8
        for (int c = 0; c < kEight; ++c) keep(lanes[c], channels + (i + c) * kPixels + v * kEight);
      }
    }
    for (int o = 0; o < out_; o += kPlanes) {
      const float* weights = &weights_[static_cast<std::size_t>(o) * in_];
      Eight sums[kPlanes][kVectors];
#pragma GCC unroll 2
      for (int plane = 0; plane < kPlanes; ++plane) {
#pragma GCC unroll 4
        for (Eight& sum : sums[plane]) sum = Eight{} + bias_[o + plane];
      }
      for (int i = 0; i < in_; ++i) {
#pragma GCC unroll 2
        for (int plane = 0; plane < kPlanes; ++plane) {
#pragma GCC unroll 4
          for (int v = 0; v < kVectors; ++v) {
            sums[plane][v] += eight(channels + i * kPixels + v * kEight) * weights[plane * in_ + i];
          }
        }
      }
#pragma GCC unroll 2
      for (int plane = 0; plane < kPlanes; ++plane) {
        float* to =
            volume + (o + plane) * plane_values + static_cast<std::ptrdiff_t>(y) * size.width + x;
#pragma GCC unroll 4
        for (int v = 0; v < kVectors; ++v) {
          Eight& sum = sums[plane][v];
          const EightBits bits = reinterpret_cast<EightBits>(sum) & magnitudes[v];
          largest = bits > largest ? bits : largest;
          sum = sum <= 0 ? Eight{} : sum;
        }
        if (count == kPixels) {
          // The next pixels but one: written long ago, if ever.
          __builtin_prefetch(to + 2 * kPixels, 1);
          __builtin_prefetch(to + 2 * kPixels + kPixels / 2, 1);
#pragma GCC unroll 4
          for (int v = 0; v < kVectors; ++v) {
            *reinterpret_cast<EightInMemory*>(to + v * kEight) = sums[plane][v];
          }
        } else {
          std::memcpy(to, sums[plane], count * sizeof(float));
        }
      }
    }
  }
  std::uint32_t most = 0;
  for (int lane = 0; lane < kEight; ++lane) most = std::max<std::uint32_t>(most, largest[lane]);
  return most < std::bit_cast<std::uint32_t>(std::numeric_limits<float>::infinity());
}

}  // namespace eventgan
