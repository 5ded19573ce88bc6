#include "pipeline/generators/weights_warning.h"

#include <optional>

#include "manifests/values/weights.h"
#include "stages/generator/shipped_weights.h"

namespace eventgan {

std::string untrained_warning(const std::string& name) {
  return "the generator is UNTRAINED (" + name + "): random patterns, not events";
}

std::string weights_warning(const JobManifest& manifest) {
  const std::string& weights = manifest.generator.weights;
  const std::optional<WeightsName> name = parse_weights_name(weights);
  if (manifest.generator.kind != GeneratorKind::kNetwork || !name) return "";
  if (name->origin == WeightsOrigin::kUntrained) return untrained_warning(weights);
  if (name->origin == WeightsOrigin::kFile) return "";
  return shipped_weights_name(weights) +
         " are stand-in weights; import or train your own to publish";
}

}  // namespace eventgan
