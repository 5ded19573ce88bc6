#include "pipeline/generation/choose_engine.h"

#include <string_view>
#include <utility>

#include "manifests/faults.h"

namespace eventgan {
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

EngineChoice chosen(Engine engine, std::string reason) { return {engine, std::move(reason), ""}; }

[[noreturn]] void refuse_precision(Precision precision, const EngineSupport& support) {
  throw UsageError("$.generator.precision: expected \"float32\", got " +
                   quoted(to_string(precision)) + ": " + lack(Engine::kOnednn, precision, support) +
                   ", and " + lack(Engine::kTorch, precision, support));
}

EngineChoice asked(Engine engine, Precision precision, const EngineSupport& support) {
  const std::string missing = lack(engine, precision, support);
  if (missing.empty()) return chosen(engine, "as the manifest says");
  const Engine other = engine == Engine::kTorch ? Engine::kOnednn : Engine::kTorch;
  if (!lack(other, precision, support).empty()) refuse_precision(precision, support);
  throw UsageError("$.generator.engine: expected \"auto\" or " + quoted(to_string(other)) +
                   " for " + std::string(to_string(precision)) + ", got " +
                   quoted(to_string(engine)) + ": " + missing);
}

EngineChoice fastest(Precision precision, const EngineSupport& support) {
  const std::string missing = lack(Engine::kOnednn, precision, support);
  if (missing.empty()) {
    return chosen(Engine::kOnednn, "auto: the fastest engine for " +
                                       std::string(to_string(precision)) + " on this processor");
  }
  if (!lack(Engine::kTorch, precision, support).empty()) refuse_precision(precision, support);
  return chosen(Engine::kTorch, "auto: " + missing);
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

EngineChoice choose_engine(const EngineRequest& request, const EngineSupport& support) {
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
