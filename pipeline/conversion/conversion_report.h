#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "manifests/marker.h"
#include "manifests/plan.h"

namespace eventgan {

/// What a run did, over all shards of the plan.
struct ConversionReport {
  std::string folder;
  std::int64_t planned = 0;
  std::int64_t written = 0;
  std::vector<QuarantinedSample> quarantined;
  std::int64_t without_partner = 0;  ///< labelled frames whose sequence ends too early
  int shards_planned = 0;
  int shards_done = 0;  ///< by this run and before it
  int shards_done_before = 0;
  std::int64_t stored_bytes = 0;  ///< size of the shards
  std::int64_t volume_bytes = 0;  ///< size of their volumes uncompressed, in the stored type
  std::map<std::string, double> stage_seconds;  ///< busy time by stage, of this run
  double wall_seconds = 0;
  bool too_many_faults = false;  ///< the manifest's limits for quarantined samples are passed

  bool complete() const { return shards_done == shards_planned; }
};

/// A few lines for a person; quarantined samples are listed up to a number, then counted.
std::string to_text(const ConversionReport& report);

/// One line of JSON.
std::string to_json(const ConversionReport& report);

}  // namespace eventgan
