#include "pipeline/generators/weights_warning.h"

#include <optional>

#include "manifests/values/weights.h"
#include "stages/generator/shipped_weights.h"

namespace eventgan {

std::string untrained_warning(const std::string& name) {
  return "the generator is UNTRAINED (" + name +
         "): its volumes are random patterns, not events. Fit for trying the program, for nothing "
         "else.";
}

std::string weights_warning(const JobManifest& manifest) {
  const std::string& weights = manifest.generator.weights;
  const std::optional<WeightsName> name = parse_weights_name(weights);
  if (manifest.generator.kind != GeneratorKind::kNetwork || !name) return "";
  if (name->origin == WeightsOrigin::kUntrained) return untrained_warning(weights);
  if (name->origin == WeightsOrigin::kFile) return "";
  return "the weights are those that come with the program (" + shipped_weights_name(weights) +
         "), trained on four seconds of recordings: fit to try things with. For results import or "
         "train weights (README, \"The generator's weights\").";
}

}  // namespace eventgan
