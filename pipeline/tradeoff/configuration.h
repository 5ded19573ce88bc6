#pragma once

#include <optional>
#include <string>
#include <vector>

#include "manifests/values/frames.h"
#include "manifests/values/job.h"

namespace eventgan {

/// What decides a volume before it is stored: a point on every axis but the stored type's. A new
/// axis is a field here, a loop in `computations`, a word in `name_of` and a key in `trial_job`.
struct Computation {
  GeneratorKind method = GeneratorKind::kNetwork;
  std::string weights;                        ///< as the manifest writes them; a simulator: empty
  Precision precision = Precision::kFloat32;  ///< the network's
  double size = 1;                            ///< of the volume's sides, 1 as in the manifest
  Scope scope = Scope::kWhole;                ///< the network's
  bool operator==(const Computation&) const = default;
};

/// A way to run a job.
struct Configuration {
  Computation computation;
  StoredType dtype = StoredType::kFloat16;
  bool operator==(const Configuration&) const = default;
};

/// The one that a manifest says; of precision "auto" what this processor takes.
Configuration own_configuration(const JobManifest& manifest);

/// What is compared: every combination. Simulators have no weights, precision and scope.
struct TradeoffAxes {
  std::vector<GeneratorKind> methods;
  std::vector<std::string> weights;
  std::vector<Precision> precisions;
  std::vector<double> sizes;  ///< in 0.05..4
  std::vector<StoredType> dtypes;
  std::vector<Scope> scopes{Scope::kWhole};
};

/// All combinations, the last axis fastest, the stored type left out.
std::vector<Computation> computations(const TradeoffAxes& axes);

/// "shipped:16 float32 motion x0.75", "shipped:16 int8 x1" (the whole), "esim x1".
std::string name_of(const Computation& computation);

/// The same with the stored type at the end.
std::string name_of(const Configuration& configuration);

/// A job as a configuration runs it.
struct TrialJob {
  JobManifest manifest;  ///< its text too is the configuration's, so it can be run as it is
  std::vector<std::string> lines;  ///< those of its keys that a user pastes into the manifest
};

/// The manifest with the configuration's keys: `image.width` and `height` (size other than 1),
/// `generator`, `output.dtype`; everything else stays. A simulator takes the manifest's sensor if
/// it has one. `whole` is the size of the volumes at size 1, needed where the manifest says none
/// and the size is not 1. Throws UsageError if there is none, or if the manifest's reader refuses
/// the result (a side below 16 pixels).
TrialJob trial_job(const JobManifest& manifest, const Configuration& configuration,
                   std::optional<ImageSize> whole);

}  // namespace eventgan
