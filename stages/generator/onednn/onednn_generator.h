#pragma once

#include <memory>
#include <string>

#include "manifests/values/job.h"
#include "manifests/values/tiles.h"
#include "stages/generator/generator.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// What this build and this processor can do with oneDNN in one precision.
struct OnednnSupport {
  bool built = false;   ///< the build found oneDNN
  bool able = false;    ///< it has compiled kernels for the precision here, not loops alone
  bool native = false;  ///< and instructions made for it, so that the precision is worth its error
  /// What oneDNN takes the processor for, ONEDNN_MAX_CPU_ISA minded: "avx512_core_vnni".
  std::string instruction_set;
};

/// Thread safe; the same during the whole life of a process.
OnednnSupport onednn_support(Precision precision);

/// Throws as check_weights, and std::runtime_error if `onednn_support(precision)` is not able.
void require_onednn(const Weights& weights, Precision precision);

/// The fast engine: oneDNN's convolutions with bias and activation fused, weights laid out once for
/// all image sizes, and for each size a plan that is built on its first use and then runs in
/// buffers that are there already. The nearest doubling before a decoder's convolution is not
/// computed: its four phases are one 2x2 convolution on the small image (decoder_kernels.h),
/// exact in real arithmetic for every image size.
///
/// One intra-operation thread per calling thread, set on its first call; how the kernels split
/// their work, and with it the last bits, depends on that. What is kept as long as the generator
/// lives: weights in each layout that oneDNN has asked for (a few, whatever the sizes), the plans
/// of the sizes used last, a block of buffers for each call that ran at the same time.
///
/// kInt8: frames that are not finite give a volume of NaN, since 8 bits would hide them.
///
/// Throws as require_onednn; as int8_numbers (std::invalid_argument for kInt8 without
/// weights.calibration, or for numbers that 8 bits cannot serve); std::runtime_error if oneDNN
/// fails.
std::unique_ptr<Generator> make_onednn_generator(const Weights& weights, Precision precision);

/// Which share of a whole image's work generate_tiles takes for these tiles, about: 0 where none is
/// wanted, 1 where all is computed, as in a build without oneDNN. It is more than the tiles' own
/// share, since what is exact in a tile takes far surroundings on the coarse levels. Pure.
double tiles_work(const TileMask& wanted, int base_channels, Precision precision);

/// How many times as fast as float32 int8 is on this processor: infinity where it has instructions
/// for it, 0 where int8 is not able, else measured, by processor time, on a small image with these
/// weights, which carry a calibration (a tenth of a second at width 8, half a one at 16, once for
/// each width in a process; repeated measurements differ by some per cent). Thread safe. Throws as
/// make_onednn_generator.
double int8_speedup(const Weights& weights);

}  // namespace eventgan
