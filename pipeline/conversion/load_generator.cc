#include "pipeline/conversion/load_generator.h"

#include <charconv>

#include "manifests/faults.h"
#include "stages/generator/torch_generator.h"
#include "stages/generator/untrained.h"
#include "stages/generator/weights_file.h"
#include "stages/shards/sha256.h"

namespace eventgan {
namespace {

constexpr std::string_view kUntrained = "untrained:";
constexpr int kLargestUntrainedWidth = 64;

int untrained_width(const std::string& weights) {
  const char* first = weights.data() + kUntrained.size();
  const char* last = weights.data() + weights.size();
  int width = 0;
  const auto [end, error] = std::from_chars(first, last, width);
  if (error != std::errc() || end != last || width < 1 || width > kLargestUntrainedWidth) {
    throw UsageError("$.generator.weights: expected untrained:WIDTH with WIDTH in 1.." +
                     std::to_string(kLargestUntrainedWidth) + ", got \"" + weights + "\"");
  }
  return width;
}

}  // namespace

LoadedGenerator load_generator(const JobManifest& manifest) {
  const std::string& name = manifest.generator.weights;
  LoadedGenerator loaded;
  Weights weights;
  if (name.starts_with(kUntrained)) {
    weights = untrained_weights(untrained_width(name), manifest.volume.bins, manifest.seed);
    loaded.weights_hash = sha256_hex(serialize_weights(weights));
    loaded.warning = "the generator is UNTRAINED (" + name +
                     "): its volumes are random patterns, not events. Fit for trying the program, "
                     "for nothing else.";
  } else {
    const auto file = resolve(manifest, name);
    weights = read_weights(file);
    loaded.weights_hash = sha256_of_file(file);
  }
  if (weights.bins != manifest.volume.bins) {
    throw UsageError("$.volume.bins: expected " + std::to_string(weights.bins) +
                     " as the weights have, got " + std::to_string(manifest.volume.bins));
  }
  loaded.generator = make_torch_generator(weights);
  return loaded;
}

}  // namespace eventgan
