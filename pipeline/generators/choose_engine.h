#pragma once

#include <optional>
#include <string>

#include "manifests/values/job.h"

namespace eventgan {

/// What a job asks of its engine.
struct EngineRequest {
  std::optional<Engine> engine;  ///< none: the fastest ("auto")
  Precision precision = Precision::kFloat32;
  bool calibrated = false;  ///< whether the weights carry a calibration
  std::string weights;      ///< what messages call the weights
};

/// What this program and this processor offer for one precision. "Able": it is computed by compiled
/// kernels, not by loops that take many times as long.
struct EngineSupport {
  bool onednn_built = false;
  bool onednn_able = false;
  bool torch_able = false;
  bool native = false;    ///< the processor has instructions made for the precision
  std::string processor;  ///< its instruction set, for messages: "avx512_core_vnni"
};

struct EngineChoice {
  Engine engine = Engine::kTorch;
  std::string reason;   ///< "auto: the fastest engine for float32 on this processor"
  std::string warning;  ///< not empty: why the precision is a bad bargain on this processor
};

/// The engine that a job gets: the one it asks for, else oneDNN where that is built in and able,
/// else LibTorch. Throws UsageError saying what the weights, the program or the processor lack, and
/// what would work. Pure.
EngineChoice choose_engine(const EngineRequest& request, const EngineSupport& support);

/// What there is for a precision on the processor that runs this, as oneDNN sees it
/// (ONEDNN_MAX_CPU_ISA minded).
EngineSupport engine_support(Precision precision);

}  // namespace eventgan
