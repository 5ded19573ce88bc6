#include "pipeline/generation/load_generator.h"

#include <optional>

#include "manifests/faults.h"
#include "manifests/weights_name.h"
#include "pipeline/generation/simulated_generator.h"
#include "stages/files/sha256.h"
#include "stages/generator/torch/torch_generator.h"
#include "stages/generator/untrained.h"
#include "stages/generator/weights_files/shipped_weights.h"
#include "stages/generator/weights_files/weights_file.h"

namespace eventgan {
namespace {

Weights load_weights(const JobManifest& manifest, LoadedGenerator& loaded) {
  const std::optional<WeightsName> name = parse_weights_name(manifest.generator.weights);
  if (!name) {
    throw UsageError(
        "$.generator.weights: expected a file, shipped, shipped:WIDTH or untrained:WIDTH with "
        "WIDTH in 1.." +
        std::to_string(kLargestNamedWidth) + ", got \"" + manifest.generator.weights + "\"");
  }
  if (name->origin == WeightsOrigin::kShipped) {
    const int width = name->width ? *name->width : default_shipped_width();
    loaded.weights_hash = sha256_hex(shipped_weights_bytes(width));
    return read_shipped_weights(width);
  }
  if (name->origin == WeightsOrigin::kUntrained) {
    Weights weights = untrained_weights(name->width.value(), manifest.volume.bins, manifest.seed);
    loaded.weights_hash = sha256_hex(serialize_weights(weights));
    loaded.warning = "the generator is UNTRAINED (" + manifest.generator.weights +
                     "): its volumes are random patterns, not events. Fit for trying the program, "
                     "for nothing else.";
    return weights;
  }
  const auto file = resolve(manifest, name->path);
  Weights weights = read_weights(file);
  loaded.weights_hash = sha256_of_file(file);
  return weights;
}

}  // namespace

LoadedGenerator load_generator(const JobManifest& manifest) {
  LoadedGenerator loaded;
  if (manifest.generator.kind != GeneratorKind::kNetwork) {
    loaded.generator =
        make_simulated_generator(manifest.generator, manifest.volume.bins, manifest.seed);
    loaded.weights_hash = sha256_hex(loaded.generator->description());
    return loaded;
  }
  const Weights weights = load_weights(manifest, loaded);
  if (weights.bins != manifest.volume.bins) {
    throw UsageError("$.volume.bins: expected " + std::to_string(weights.bins) +
                     " as the weights have, got " + std::to_string(manifest.volume.bins));
  }
  loaded.generator = make_torch_generator(weights);
  return loaded;
}

}  // namespace eventgan
