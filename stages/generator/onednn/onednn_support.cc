#include "stages/generator/onednn/onednn_support.h"

#include <dnnl.hpp>

namespace eventgan {
namespace {

/// Steps of what processors can, as far as the engine's kernels differ.
struct InstructionSet {
  const char* name = "none that oneDNN compiles for";
  bool compiled = false;       ///< float32 convolutions are compiled, not loops
  bool avx2 = false;           ///< and int8 ones
  bool avx512 = false;         ///< and bfloat16 ones, if only by emulation
  bool int8_products = false;  ///< VNNI or AMX
  bool bfloat16_products = false;
};

InstructionSet instruction_set_of(dnnl::cpu_isa isa) {
  switch (isa) {
    case dnnl::cpu_isa::sse41:
      return {"sse41", true};
    case dnnl::cpu_isa::avx:
      return {"avx", true};
    case dnnl::cpu_isa::avx2:
      return {"avx2", true, true};
    case dnnl::cpu_isa::avx2_vnni:
      return {"avx2_vnni", true, true, false, true};
    case dnnl::cpu_isa::avx512_core:
      return {"avx512_core", true, true, true};
    case dnnl::cpu_isa::avx512_core_vnni:
      return {"avx512_core_vnni", true, true, true, true};
    case dnnl::cpu_isa::avx512_core_bf16:
      return {"avx512_core_bf16", true, true, true, true, true};
    case dnnl::cpu_isa::avx512_core_amx:
      return {"avx512_core_amx", true, true, true, true, true};
    default:
      return {};
  }
}

}  // namespace

OnednnSupport onednn_support(Precision precision) {
  const InstructionSet set = instruction_set_of(dnnl::get_effective_cpu_isa());
  OnednnSupport support{.built = true, .instruction_set = set.name};
  switch (precision) {
    case Precision::kFloat32:
      support.able = support.native = set.compiled;
      break;
    case Precision::kBfloat16:
      support.able = set.avx512;
      support.native = set.bfloat16_products;
      break;
    case Precision::kInt8:
      support.able = set.avx2;
      support.native = set.int8_products;
      break;
  }
  return support;
}

}  // namespace eventgan
