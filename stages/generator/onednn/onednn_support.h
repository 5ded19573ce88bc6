#pragma once

#include <string>

#include "manifests/engine.h"

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

}  // namespace eventgan
