#pragma once

#include <memory>
#include <string>
#include <vector>

#include "manifests/values/job.h"
#include "stages/generator/generator.h"
#include "stages/generator/weights.h"

namespace eventgan {

/// What the user must know of the weights that a manifest asks for, by their name alone, in a short
/// line: that they are untrained, or those that come with the program. Empty for others, and for
/// kinds without weights.
std::string weights_warning(const JobManifest& manifest);

/// The weights a manifest asks for.
struct LoadedWeights {
  Weights weights;
  std::string hash;     ///< SHA-256 of the weights file; untrained: of what the file would be
  std::string warning;  ///< not empty: what the user must know before trusting the volumes
};

/// Loads the weights that a path or "shipped" names, or makes untrained ones for "untrained:WIDTH"
/// (seeded by the manifest). Throws InputError if the weights cannot be used, UsageError if the
/// name is none or the weights' bins are not the manifest's.
LoadedWeights load_weights(const JobManifest& manifest);

/// The generator a manifest asks for.
struct LoadedGenerator {
  std::unique_ptr<Generator> generator;
  /// SHA-256 of the weights file (untrained: of what the file would be; of a kind without
  /// weights: of its description).
  std::string weights_hash;
  /// The engine that was chosen, for people: "generator: onednn float32 on avx2, trained on gaps
  /// 1-6"; empty for a simulator.
  std::string choice;
  std::vector<std::string> warnings;  ///< what the user must know before trusting the volumes
};

/// Loads the weights and makes the engine for them (load_weights, choose_engine), or sets up what
/// has none, as the kind's row says (manifests/values/generators.h); throws as they do, and
/// InputError if the engine refuses the weights.
LoadedGenerator load_generator(const JobManifest& manifest);

/// The fastest engine of this processor in float32. Throws as the engines do.
std::unique_ptr<Generator> make_fastest_generator(const Weights& weights);

}  // namespace eventgan
