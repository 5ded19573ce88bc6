#include "pipeline/generation/load_generator.h"

#include <exception>
#include <stdexcept>
#include <utility>

#include "manifests/faults.h"
#include "pipeline/generation/choose_engine.h"
#include "pipeline/generation/engine_support.h"
#include "pipeline/generation/load_weights.h"
#include "pipeline/generation/simulated_generator.h"
#include "stages/files/sha256.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/torch/torch_generator.h"

namespace eventgan {
namespace {

LoadedGenerator load_simulator(const JobManifest& manifest) {
  LoadedGenerator loaded;
  loaded.generator =
      make_simulated_generator(manifest.generator, manifest.volume.bins, manifest.seed);
  loaded.weights_hash = sha256_hex(loaded.generator->description());
  return loaded;
}

std::string choice_text(const EngineChoice& choice, Precision precision,
                        const EngineSupport& support, const std::optional<GapRange>& gaps) {
  std::string text = "generator: ";
  text.append(to_string(choice.engine)).append(" ").append(to_string(precision));
  text += " on " + support.processor + " (" + choice.reason + "), " + describe_training_gaps(gaps);
  return gaps ? text : text + ", so none is marked as extrapolated";
}

/// Weights that the engine refuses are an input that cannot be used.
std::unique_ptr<Generator> make_engine(Engine engine, const Weights& weights,
                                       const GeneratorSpec& spec) try {
  return engine == Engine::kOnednn ? make_onednn_generator(weights, spec.precision)
                                   : make_torch_generator(weights, spec.precision);
} catch (const std::invalid_argument&) {
  std::throw_with_nested(InputError("cannot use the weights " + spec.weights + " in " +
                                    std::string(to_string(spec.precision))));
}

}  // namespace

LoadedGenerator load_generator(const JobManifest& manifest) {
  const GeneratorSpec& spec = manifest.generator;
  if (spec.kind != GeneratorKind::kNetwork) return load_simulator(manifest);
  LoadedWeights loaded = load_weights(manifest);
  const EngineSupport support = engine_support(spec.precision);
  const EngineChoice choice = choose_engine(
      {spec.engine, spec.precision, loaded.weights.calibration != nullptr, spec.weights}, support);
  LoadedGenerator result;
  result.generator = make_engine(choice.engine, loaded.weights, spec);
  result.weights_hash = std::move(loaded.hash);
  result.choice = choice_text(choice, spec.precision, support, loaded.weights.training_gaps);
  for (const std::string& warning : {loaded.warning, choice.warning}) {
    if (!warning.empty()) result.warnings.push_back(warning);
  }
  return result;
}

}  // namespace eventgan
