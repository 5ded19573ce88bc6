#pragma once

#include <memory>
#include <string>

#include "manifests/job_manifest.h"
#include "stages/generator/generator.h"

namespace eventgan {

/// The generator a manifest asks for.
struct LoadedGenerator {
  std::unique_ptr<Generator> generator;
  /// SHA-256 of the weights file (untrained: of what the file would be; a simulator, which has
  /// none: of its description).
  std::string weights_hash;
  std::string warning;  ///< not empty: what the user must know before trusting the volumes
};

/// Loads the weights that a path or "shipped" names, or makes untrained ones for "untrained:WIDTH"
/// (seeded by the manifest); or sets up the manifest's simulator. Throws InputError if the weights
/// cannot be used, UsageError if their bins are not the manifest's.
LoadedGenerator load_generator(const JobManifest& manifest);

}  // namespace eventgan
