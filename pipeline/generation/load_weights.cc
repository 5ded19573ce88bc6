#include "pipeline/generation/load_weights.h"

#include <optional>

#include "manifests/faults.h"
#include "manifests/weights_name.h"
#include "stages/files/sha256.h"
#include "stages/generator/untrained.h"
#include "stages/generator/weights_files/shipped_weights.h"
#include "stages/generator/weights_files/weights_file.h"

namespace eventgan {
namespace {

/// Weights that untrained_weights made, and what was made of them (a calibration), say so.
std::string untrained_warning(const Weights& weights, const std::string& name) {
  const auto origin = weights.metadata.find("origin");
  if (origin == weights.metadata.end() || !origin->second.starts_with("untrained")) return "";
  return "the generator is UNTRAINED (" + name +
         "): its volumes are random patterns, not events. Fit for trying the program, for nothing "
         "else.";
}

LoadedWeights named_weights(const JobManifest& manifest) {
  const std::optional<WeightsName> name = parse_weights_name(manifest.generator.weights);
  if (!name) {
    throw UsageError(
        "$.generator.weights: expected a file, shipped, shipped:WIDTH or untrained:WIDTH with "
        "WIDTH in 1.." +
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
  const auto file = resolve(manifest, name->path);
  return {read_weights(file), sha256_of_file(file), ""};
}

}  // namespace

LoadedWeights load_weights(const JobManifest& manifest) {
  LoadedWeights loaded = named_weights(manifest);
  if (loaded.weights.bins != manifest.volume.bins) {
    throw UsageError("$.volume.bins: expected " + std::to_string(loaded.weights.bins) +
                     " as the weights have, got " + std::to_string(manifest.volume.bins));
  }
  loaded.warning = untrained_warning(loaded.weights, manifest.generator.weights);
  return loaded;
}

}  // namespace eventgan
