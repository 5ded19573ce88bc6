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
  Device device = Device::kCpu;
};

/// What this program and this machine offer for one precision on one device. "Able": it is computed
/// by compiled kernels, not by loops that take many times as long.
struct EngineSupport {
  bool onednn_built = false;
  bool onednn_able = false;
  bool torch_able = false;
  bool native = false;    ///< the processor has instructions made for the precision
  std::string processor;  ///< its instruction set, for messages: "avx512_core_vnni"
  // On Device::kCuda, for messages:
  std::string cuda = {};       ///< the device; empty if there is none
  std::string cuda_lack = {};  ///< why it does not compute the precision; empty if it does
};

struct EngineChoice {
  Engine engine = Engine::kTorch;
  std::string reason;   ///< why "auto" is not the fastest one; empty where nothing needs a reason
  std::string warning;  ///< not empty: why the precision is a bad bargain on this processor
};

/// The engine that a job gets: the one it asks for, else oneDNN where that is built in and able,
/// else LibTorch; on CUDA LibTorch. Throws UsageError saying what the weights, the program, the
/// processor or the device lack, and what would work. Pure.
EngineChoice choose_engine(const EngineRequest& request, const EngineSupport& support);

/// The precision of "auto": bfloat16 where `support`, of bfloat16, has instructions made for it and
/// the engine that is asked for computes it, else float32. Pure.
Precision choose_precision(std::optional<Engine> engine, Device device,
                           const EngineSupport& support);

/// The manifest's precision, of "auto" what the processor that runs this takes.
Precision precision_of(const GeneratorSpec& spec);

/// What runs a precision on the processor that runs this, as oneDNN sees it
/// (ONEDNN_MAX_CPU_ISA minded), and, only for Device::kCuda, on the CUDA device (cuda_support).
EngineSupport engine_support(Precision precision, Device device = Device::kCpu);

}  // namespace eventgan
