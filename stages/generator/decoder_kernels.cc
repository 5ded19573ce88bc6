#include "stages/generator/decoder_kernels.h"

#include <cstddef>

namespace eventgan {
namespace {

constexpr int kSide = 3;
constexpr int kTaps = kSide * kSide;

/// First and last kernel row that fall on small row `tap` (0: above, 1: at the output's position).
struct KernelRows {
  int first = 0;
  int last = 0;
};

KernelRows rows_of(int phase, int tap) {
  if (phase == 0) return tap == 0 ? KernelRows{0, 0} : KernelRows{1, 2};
  return tap == 0 ? KernelRows{0, 1} : KernelRows{2, 2};
}

float tap_sum(const float* kernel, KernelRows rows, KernelRows columns) {
  double sum = 0;
  for (int y = rows.first; y <= rows.last; ++y) {
    for (int x = columns.first; x <= columns.last; ++x) sum += kernel[y * kSide + x];
  }
  return static_cast<float>(sum);
}

/// With rows and columns exchanged.
std::vector<float> transposed_kernel(const std::vector<float>& kernel) {
  std::vector<float> transposed(kernel.size());
  for (std::size_t i = 0; i < kernel.size(); ++i) {
    const std::size_t tap = i % kTaps;
    transposed[i - tap + tap % kSide * kSide + tap / kSide] = kernel[i];
  }
  return transposed;
}

/// Input channels first .. first + count - 1.
std::vector<float> input_slice(const std::vector<float>& kernel, int out_channels, int in_channels,
                               int first, int count) {
  std::vector<float> slice;
  slice.reserve(static_cast<std::size_t>(out_channels) * count * kTaps);
  for (int out = 0; out < out_channels; ++out) {
    const auto begin =
        kernel.begin() + (static_cast<std::ptrdiff_t>(out) * in_channels + first) * kTaps;
    slice.insert(slice.end(), begin, begin + count * kTaps);
  }
  return slice;
}

}  // namespace

std::vector<float> phase_kernel(const std::vector<float>& kernel, int out_channels,
                                int in_channels) {
  const std::size_t pairs = static_cast<std::size_t>(out_channels) * in_channels;
  std::vector<float> phases;
  phases.reserve(4 * pairs * 4);
  for (int phase = 0; phase < 4; ++phase) {
    for (std::size_t pair = 0; pair < pairs; ++pair) {
      for (int tap = 0; tap < 4; ++tap) {
        phases.push_back(tap_sum(kernel.data() + pair * kTaps, rows_of(phase / 2, tap / 2),
                                 rows_of(phase % 2, tap % 2)));
      }
    }
  }
  return phases;
}

DecoderKernels decoder_kernels(const Convolution& decoder) {
  const int out = decoder.out_channels;
  const int all = decoder.in_channels;
  DecoderKernels kernels;
  kernels.doubled_channels = all - out;
  kernels.doubled = input_slice(decoder.weight, out, all, 0, kernels.doubled_channels);
  kernels.skip = input_slice(decoder.weight, out, all, kernels.doubled_channels, out);
  kernels.transposed = transposed_kernel(kernels.doubled);
  kernels.phases = phase_kernel(kernels.doubled, out, kernels.doubled_channels);
  return kernels;
}

}  // namespace eventgan
