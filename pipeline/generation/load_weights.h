#pragma once

#include <string>

#include "manifests/job_manifest.h"
#include "stages/generator/weights.h"

namespace eventgan {

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

}  // namespace eventgan
