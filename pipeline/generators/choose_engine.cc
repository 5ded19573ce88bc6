#include "pipeline/generators/choose_engine.h"

#include <string_view>
#include <utility>

#include "manifests/values/faults.h"
#include "stages/base/processor/processor.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/torch/torch_generator.h"

namespace eventgan {
namespace {

/// For a program without oneDNN, which has better names.
std::string instruction_set_name() {
  if (instruction_sets() == "other") return "not x86-64";
  return has_avx512() ? "x86-64 with AVX-512" : "x86-64 without AVX-512";
}

/// LibTorch asks the processor for AVX-512 before it gives a bfloat16 convolution to its oneDNN
/// (mkldnn_bf16_device_check); else it takes loops of its own. It does not ask oneDNN, which fails
/// where ONEDNN_MAX_CPU_ISA forbids it more than the processor does.
bool torch_able(Precision precision, const OnednnSupport& onednn) {
  if (precision != Precision::kBfloat16) return precision == Precision::kFloat32;
  return has_avx512() && (onednn.able || !onednn.built);
}

}  // namespace

EngineSupport engine_support(Precision precision, Device device) {
  const OnednnSupport onednn = onednn_support(precision);
  EngineSupport support;
  support.onednn_built = onednn.built;
  support.onednn_able = onednn.able;
  support.torch_able = torch_able(precision, onednn);
  support.native =
      onednn.built ? onednn.native : precision != Precision::kBfloat16 || has_bfloat16();
  support.processor = onednn.built ? onednn.instruction_set : instruction_set_name();
  if (device == Device::kCuda) {
    CudaSupport cuda = cuda_support(precision);
    support.cuda = std::move(cuda.device);
    support.cuda_lack = std::move(cuda.lack);
  }
  return support;
}

namespace {

std::string quoted(std::string_view word) { return "\"" + std::string(word) + "\""; }

/// What keeps an engine from the precision; empty if nothing does.
std::string lack(Engine engine, Precision precision, const EngineSupport& support) {
  const std::string name(to_string(precision));
  if (engine == Engine::kTorch) {
    if (support.torch_able) return "";
    if (precision == Precision::kInt8) return "LibTorch has no int8 for this network";
    return "LibTorch has no fast kernels for " + name + " on this processor (" + support.processor +
           ")";
  }
  if (!support.onednn_built) return "this program was built without oneDNN";
  if (support.onednn_able) return "";
  return "oneDNN has no compiled kernels for " + name + " on this processor (" + support.processor +
         ")";
}

[[noreturn]] void refuse_precision(Precision precision, const EngineSupport& support) {
  throw UsageError("$.generator.precision: expected \"float32\", got " +
                   quoted(to_string(precision)) + ": " + lack(Engine::kOnednn, precision, support) +
                   ", and " + lack(Engine::kTorch, precision, support));
}

EngineChoice asked(Engine engine, Precision precision, const EngineSupport& support) {
  const std::string missing = lack(engine, precision, support);
  if (missing.empty()) return {engine, "", ""};
  const Engine other = engine == Engine::kTorch ? Engine::kOnednn : Engine::kTorch;
  if (!lack(other, precision, support).empty()) refuse_precision(precision, support);
  throw UsageError("$.generator.engine: expected \"auto\" or " + quoted(to_string(other)) +
                   " for " + std::string(to_string(precision)) + ", got " +
                   quoted(to_string(engine)) + ": " + missing);
}

EngineChoice fastest(Precision precision, const EngineSupport& support) {
  const std::string missing = lack(Engine::kOnednn, precision, support);
  if (missing.empty()) return {Engine::kOnednn, "", ""};
  if (!lack(Engine::kTorch, precision, support).empty()) refuse_precision(precision, support);
  return {Engine::kTorch, missing, ""};
}

EngineChoice on_cuda(const EngineRequest& request, const EngineSupport& support) {
  if (request.engine == Engine::kOnednn) {
    throw UsageError(
        "$.generator.engine: expected \"auto\" or \"torch\" on device cuda, got \"onednn\", which "
        "runs on the CPU only");
  }
  if (request.precision == Precision::kInt8) {
    throw UsageError(
        "$.generator.precision: expected \"float32\" or \"bfloat16\" on device cuda, got \"int8\", "
        "which only oneDNN on the CPU has");
  }
  if (support.cuda.empty()) {
    throw UsageError("$.generator.device: expected \"cpu\", got \"cuda\": " + support.cuda_lack);
  }
  if (!support.cuda_lack.empty()) {
    throw UsageError("$.generator.precision: expected \"float32\", got " +
                     quoted(to_string(request.precision)) + ": " + support.cuda_lack);
  }
  return {Engine::kTorch, "", ""};
}

/// Why a precision is a bad bargain on this processor; empty if it is none.
std::string advice(Precision precision, const EngineSupport& support) {
  if (precision == Precision::kFloat32 || support.native) return "";
  return "precision " + std::string(to_string(precision)) + ": this processor (" +
         support.processor + ") has no instructions for it" +
         (precision == Precision::kInt8 ? ", so it gains less than elsewhere; float32 is exact"
                                        : "; float32 is both faster and exact here");
}

}  // namespace

Precision choose_precision(std::optional<Engine> engine, Device device,
                           const EngineSupport& support) {
  const auto able = [&](Engine one) { return lack(one, Precision::kBfloat16, support).empty(); };
  const bool is_good =
      device == Device::kCuda
          ? !support.cuda.empty() && support.cuda_lack.empty()
          : support.native &&
                (engine ? able(*engine) : able(Engine::kOnednn) || able(Engine::kTorch));
  return is_good ? Precision::kBfloat16 : Precision::kFloat32;
}

Precision precision_of(const GeneratorSpec& spec) {
  if (spec.precision) return *spec.precision;
  return choose_precision(spec.engine, spec.device,
                          engine_support(Precision::kBfloat16, spec.device));
}

EngineChoice choose_engine(const EngineRequest& request, const EngineSupport& support) {
  if (request.device == Device::kCuda) return on_cuda(request, support);
  EngineChoice choice = request.engine ? asked(*request.engine, request.precision, support)
                                       : fastest(request.precision, support);
  if (request.precision == Precision::kInt8 && !request.calibrated) {
    throw UsageError("$.generator.weights: expected weights with a calibration for int8, got " +
                     request.weights + " without one; run eventgan calibrate MANIFEST");
  }
  choice.warning = advice(request.precision, support);
  return choice;
}

}  // namespace eventgan
