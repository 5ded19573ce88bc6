#pragma once

#include <memory>

#include "manifests/engine.h"
#include "stages/generator/generator.h"
#include "stages/generator/onednn/onednn_support.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// The fast engine: oneDNN's convolutions with bias and activation fused, weights laid out once for
/// all picture sizes, and for each size a plan that is built on its first use and then runs in
/// buffers that are there already. The nearest doubling before a decoder's convolution is not
/// computed: its four phases are one 2x2 convolution on the small picture (decoder_kernels.h),
/// exact in real arithmetic for every picture size.
///
/// One intra-operation thread per calling thread, set on its first call; how the kernels split
/// their work, and with it the last bits, depends on that. What is kept as long as the generator
/// lives: weights in each layout that oneDNN has asked for (a few, whatever the sizes), the plans
/// of the sizes used last, a block of buffers for each call that ran at the same time.
///
/// kInt8: frames that are not finite give a volume of NaN, since 8 bits would hide them.
///
/// Throws as check_weights; as int8_numbers (std::invalid_argument for kInt8 without
/// weights.calibration, or for numbers that 8 bits cannot serve); std::runtime_error if
/// `onednn_support(precision)` is not able or oneDNN fails.
std::unique_ptr<Generator> make_onednn_generator(const Weights& weights, Precision precision);

}  // namespace eventgan
