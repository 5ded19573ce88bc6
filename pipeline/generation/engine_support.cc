#include "pipeline/generation/engine_support.h"

#include "stages/generator/onednn/onednn_support.h"

namespace eventgan {
namespace {

/// What LibTorch asks of an x86-64 processor before it gives a bfloat16 convolution to its oneDNN
/// (mkldnn_bf16_device_check); else it takes loops of its own. It does not ask oneDNN, which fails
/// where ONEDNN_MAX_CPU_ISA forbids it more than the processor does.
bool has_avx512() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
         __builtin_cpu_supports("avx512dq");
#else
  return false;
#endif
}

bool has_bfloat16() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx512bf16");  // every processor with AMX for it has these too
#else
  return false;
#endif
}

/// For a program without oneDNN, which has better names.
std::string processor_name() {
#if defined(__x86_64__)
  return has_avx512() ? "x86-64 with AVX-512" : "x86-64 without AVX-512";
#else
  return "not x86-64";
#endif
}

bool torch_able(Precision precision, const OnednnSupport& onednn) {
  if (precision != Precision::kBfloat16) return precision == Precision::kFloat32;
  return has_avx512() && (onednn.able || !onednn.built);
}

}  // namespace

EngineSupport engine_support(Precision precision) {
  const OnednnSupport onednn = onednn_support(precision);
  EngineSupport support;
  support.onednn_built = onednn.built;
  support.onednn_able = onednn.able;
  support.torch_able = torch_able(precision, onednn);
  support.native =
      onednn.built ? onednn.native : precision != Precision::kBfloat16 || has_bfloat16();
  support.processor = onednn.built ? onednn.instruction_set : processor_name();
  return support;
}

}  // namespace eventgan
