#pragma once

#include <vector>

#include "stages/generator/weights.h"

namespace eventgan {

/// What a 3x3 convolution (padding 1) does after nearest doubling, as one 2x2 convolution on the
/// small image: output pixel (2j + py, 2k + px) of the doubled image sees two rows and two
/// columns of the small one, so that the kernel's rows and columns that fall on one pixel are added
/// up.
///
/// kernel: [out, in, 3, 3] float32, C order; returned [4 out, in, 2, 2], channel (2 py + px) out +
/// o. With padding 1 on all sides its output pixel (p, q) holds the sub-pixel phase (py, px) of the
/// small image's pixel (p - py, q - px). Exact in real arithmetic but in the last row and column of
/// an image of odd size 2n - 1: there the 3x3 kernel sees the zero padding, the 2x2 one the small
/// image. Sums in double.
std::vector<float> phase_kernel(const std::vector<float>& kernel, int out_channels,
                                int in_channels);

/// A decoder's 3x3 convolution over [doubled x, skip connection] in the parts that the engine
/// computes.
struct DecoderKernels {
  int doubled_channels = 0;       ///< of x; the skip connection has as many as the output
  std::vector<float> skip;        ///< [out, skip channels, 3, 3]
  std::vector<float> doubled;     ///< [out, x channels, 3, 3]
  std::vector<float> transposed;  ///< the same with rows and columns exchanged
  std::vector<float> phases;      ///< phase_kernel of it
};

/// `decoder`: 3x3, [out, x channels + out, 3, 3].
DecoderKernels decoder_kernels(const Convolution& decoder);

}  // namespace eventgan
