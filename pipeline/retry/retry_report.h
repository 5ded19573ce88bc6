#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "manifests/marker.h"

namespace eventgan {

/// What a retry did.
struct RetryReport {
  std::string folder;
  std::int64_t planned = 0;             ///< samples of the whole plan
  std::int64_t tried = 0;               ///< in committed shards or found to fail again
  std::int64_t mended = 0;              ///< of these, in committed shards
  std::vector<QuarantinedSlot> failed;  ///< the others: tried again and failed again
  std::int64_t quarantined = 0;         ///< samples that are quarantined now, tried or not
  int shards_rewritten = 0;
  std::vector<std::string> damaged_shards;  ///< "PATH: expected X, got Y": left to `convert`
  int shards_missing = 0;                   ///< not made yet: left to `convert`
  /// Fields of the fingerprint in which the inputs have changed since the plan was frozen, or since
  /// the last retry: recorded, so that `convert` goes on.
  std::vector<std::string> changed_inputs;
  bool stopped = false;           ///< a request to stop came before all were tried
  bool too_many_faults = false;   ///< the manifest's limits are passed still
  bool dataset_outdated = false;  ///< dataset.json tells of the shards as they were before
  double wall_seconds = 0;
};

/// A few lines for a person; samples that failed again are listed up to a number, then counted.
std::string to_text(const RetryReport& report);

/// One line of JSON.
std::string to_json(const RetryReport& report);

}  // namespace eventgan
