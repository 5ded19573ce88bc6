#include "pipeline/generators/load_generator.h"

#include <fmt/core.h>

#include <algorithm>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>

#include "manifests/files/sha256.h"
#include "manifests/values/events.h"
#include "manifests/values/faults.h"
#include "manifests/values/weights.h"
#include "pipeline/generators/choose_engine.h"
#include "pipeline/generators/simulated_generator.h"
#include "stages/generator/onednn/onednn_generator.h"
#include "stages/generator/shipped_weights.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/weights.h"
#include "stages/generator/weights_file.h"

namespace eventgan {
namespace {

/// Weights that untrained_weights made, and what was made of them (a calibration), say so.
bool are_untrained(const Weights& weights) {
  const auto origin = weights.metadata.find("origin");
  return origin != weights.metadata.end() && origin->second.starts_with("untrained");
}

std::string untrained_warning(const std::string& name) {
  return "the generator is UNTRAINED (" + name + "): random patterns, not events";
}

/// A training may put newer weights in place meanwhile: what is hashed must be what was read.
LoadedWeights read_unchanged(const std::filesystem::path& file) {
  for (;;) {
    std::error_code missing;  // is told by what reads
    const auto written = std::filesystem::last_write_time(file, missing);
    LoadedWeights loaded{read_weights(file), sha256_of_file(file), ""};
    if (std::filesystem::last_write_time(file, missing) == written) return loaded;
  }
}

LoadedWeights named_weights(const JobManifest& manifest) {
  const std::optional<WeightsName> name = parse_weights_name(manifest.generator.weights);
  if (!name) {
    throw UsageError(
        "$.generator.weights: expected a file, shipped, shipped:sensor, or shipped:WIDTH or "
        "untrained:WIDTH with WIDTH in 1.." +
        std::to_string(kLargestNamedWidth) + ", got \"" + manifest.generator.weights + "\"");
  }
  if (name->origin == WeightsOrigin::kShipped) {
    const int width = name->width ? *name->width : default_shipped_width();
    return {read_shipped_weights(width), sha256_hex(shipped_weights_bytes(width)), ""};
  }
  if (name->origin == WeightsOrigin::kUntrained) {
    Weights weights = untrained_weights(name->width.value(), manifest.volume.bins, manifest.seed);
    std::string hash = sha256_hex(serialize_weights(weights));
    return {std::move(weights), std::move(hash), ""};
  }
  return read_unchanged(resolve(manifest, name->path));
}

}  // namespace

std::string weights_warning(const JobManifest& manifest) {
  const std::string& weights = manifest.generator.weights;
  const std::optional<WeightsName> name = parse_weights_name(weights);
  if (!has_weights(manifest.generator.kind) || !name) return "";
  if (name->origin == WeightsOrigin::kUntrained) return untrained_warning(weights);
  if (name->origin == WeightsOrigin::kFile) return "";
  return shipped_weights_name(weights) +
         " are stand-in weights; import or train your own to publish";
}

LoadedWeights load_weights(const JobManifest& manifest) {
  LoadedWeights loaded = named_weights(manifest);
  if (loaded.weights.bins != manifest.volume.bins) {
    throw UsageError("$.volume.bins: expected " + std::to_string(loaded.weights.bins) +
                     " as in the weights, got " + std::to_string(manifest.volume.bins));
  }
  loaded.warning = are_untrained(loaded.weights) ? untrained_warning(manifest.generator.weights)
                                                 : weights_warning(manifest);
  return loaded;
}

namespace {

/// Is there where a camera's events make the volumes: says what they are, and generates none.
class CameraEvents final : public Generator {
 public:
  explicit CameraEvents(int bins) : bins_(bins) {}

  int bins() const override { return bins_; }

  /// Sums are formed in double, then rounded.
  std::size_t working_bytes(ImageSize size) const override {
    return VolumeShape{bins_, size}.value_count() * sizeof(double);
  }

  GenerationNotes generate(const GeneratorInput&, std::span<float>) const override {
    throw std::logic_error("expected frames to generate events from, got events");
  }

  std::string description() const override {
    return std::string(generator_row(GeneratorKind::kEvents).title);
  }

 private:
  int bins_;
};

LoadedGenerator load_without_weights(const JobManifest& manifest) {
  const int bins = manifest.volume.bins;
  LoadedGenerator loaded;
  loaded.generator = needs_frames(manifest.generator.kind)
                         ? make_simulated_generator(manifest.generator, bins, manifest.seed)
                         : std::make_unique<CameraEvents>(bins);
  loaded.weights_hash = sha256_hex(loaded.generator->description());
  return loaded;
}

/// A sensor that the weights have not learnt would give volumes of another one.
void check_threshold(const Weights& weights, const std::string& hash, const GeneratorSpec& spec) {
  if (!spec.threshold) return;
  if (weights.thresholds && !spec.threshold_weights.empty() && spec.threshold_weights != hash) {
    throw UsageError("$.generator.sensor.network: expected the threshold of " + spec.weights +
                     ", got that of other weights (eventgan fit --weights finds it)");
  }
  if (!weights.thresholds) {
    throw UsageError(
        "$.generator.sensor.threshold: expected weights that have learnt a sensor's threshold, got "
        "others: " +
        spec.weights);
  }
  const ThresholdRange learnt = *weights.thresholds;
  const double ratio = spec.threshold->ratio;
  const ContrastThreshold least{spec.threshold->range[0], ratio};
  const ContrastThreshold most{spec.threshold->range[1], ratio};
  if (learnt.contains(least) && learnt.contains(most)) return;
  throw UsageError(fmt::format(
      "$.generator.sensor.threshold: expected {:.3g}..{:.3g} as the weights have learnt, got "
      "{:.3g}..{:.3g}{}",
      learnt.lowest, learnt.highest, std::min(least.positive(), least.negative()),
      std::max(most.positive(), most.negative()),
      ratio == 1 ? "" : fmt::format(" with threshold_ratio {:.3g}", ratio)));
}

std::string choice_text(const EngineChoice& choice, const GeneratorSpec& spec, Precision precision,
                        const EngineSupport& support, const std::optional<GapRange>& gaps) {
  std::string text = "generator: ";
  text.append(to_string(choice.engine)).append(" ").append(to_string(precision));
  text += " on " + (spec.device == Device::kCuda ? support.cuda : support.processor);
  if (!choice.reason.empty()) text += " (" + choice.reason + ")";
  return text + ", " + describe_training_gaps(gaps);
}

/// Weights that the engine refuses are an input that cannot be used.
std::unique_ptr<Generator> make_engine(Engine engine, const Weights& weights,
                                       const GeneratorSpec& spec, Precision precision) try {
  if (spec.device == Device::kCuda) {
    return make_batched_generator(weights, precision, spec.device);
  }
  return engine == Engine::kOnednn ? make_onednn_generator(weights, precision)
                                   : make_torch_generator(weights, precision);
} catch (const std::invalid_argument&) {
  std::throw_with_nested(InputError("cannot use the weights " + spec.weights + " in " +
                                    std::string(to_string(precision))));
}

}  // namespace

LoadedGenerator load_generator(const JobManifest& manifest) {
  const GeneratorSpec& spec = manifest.generator;
  if (!has_weights(spec.kind)) return load_without_weights(manifest);
  LoadedWeights loaded = load_weights(manifest);
  check_threshold(loaded.weights, loaded.hash, spec);
  const Precision precision = precision_of(spec);
  const EngineSupport support = engine_support(precision, spec.device);
  EngineChoice choice = choose_engine(
      {spec.engine, precision, loaded.weights.calibration != nullptr, spec.weights, spec.device},
      support);
  LoadedGenerator result;
  result.generator = make_engine(choice.engine, loaded.weights, spec, precision);
  if (precision == Precision::kInt8 && int8_speedup(loaded.weights) > 1) choice.warning.clear();
  result.weights_hash = std::move(loaded.hash);
  result.choice = choice_text(choice, spec, precision, support, loaded.weights.training_gaps);
  for (const std::string& warning : {loaded.warning, choice.warning}) {
    if (!warning.empty()) result.warnings.push_back(warning);
  }
  return result;
}

std::unique_ptr<Generator> make_fastest_generator(const Weights& weights) {
  return onednn_support(Precision::kFloat32).able
             ? make_onednn_generator(weights, Precision::kFloat32)
             : make_torch_generator(weights);
}

}  // namespace eventgan
