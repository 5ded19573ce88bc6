#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "manifests/values/counter_random.h"
#include "manifests/values/frames.h"
#include "stages/generator/onednn/buffers.h"
#include "stages/generator/onednn/layer_numbers.h"

namespace eventgan {

// What tries the layers that are written for AVX2.

inline constexpr float kBadNumbers[] = {std::numeric_limits<float>::quiet_NaN(),
                                        std::numeric_limits<float>::infinity(),
                                        -std::numeric_limits<float>::infinity()};

inline bool has_avx2() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
#else
  return false;
#endif
}

#define EVENTGAN_AVX2_OR_SKIP() \
  if (!has_avx2()) GTEST_SKIP() << "no AVX2 here"

/// [y, x, channel], from a cache line on.
class ChannelImage {
 public:
  ChannelImage(ImageSize size, int channels, float value = 0)
      : channels_(channels),
        width_(size.width),
        count_(size.pixel_count() * channels),
        buffer_(count_ * sizeof(float)) {
    std::fill_n(data(), count_, value);
  }

  float* data() const { return reinterpret_cast<float*>(buffer_.data()); }
  float& at(int y, int x, int channel) const {
    return data()[(static_cast<std::ptrdiff_t>(y) * width_ + x) * channels_ + channel];
  }
  std::size_t count() const { return count_; }

 private:
  int channels_, width_;
  std::size_t count_;
  PageBuffer buffer_;
};

inline std::vector<float> random_numbers(std::size_t count, std::uint64_t seed) {
  const CounterRandom random(seed);
  std::vector<float> numbers(count);
  for (std::size_t i = 0; i < count; ++i) numbers[i] = float(2 * random.uniform(i) - 1);
  return numbers;
}

inline ChannelImage random_image(ImageSize size, int channels, std::uint64_t seed) {
  ChannelImage image(size, channels);
  const auto numbers = random_numbers(image.count(), seed);
  std::copy(numbers.begin(), numbers.end(), image.data());
  return image;
}

inline LayerNumbers random_layer(int out, int in, int kernel, std::uint64_t seed) {
  return {"layer",
          out,
          in,
          kernel,
          random_numbers(static_cast<std::size_t>(out) * in * kernel * kernel, seed),
          random_numbers(static_cast<std::size_t>(out), seed + 1),
          {}};
}

}  // namespace eventgan
