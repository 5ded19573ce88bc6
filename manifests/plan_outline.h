#pragma once

#include <cstdint>
#include <iosfwd>
#include <map>
#include <string>
#include <vector>

#include "manifests/image_size.h"
#include "manifests/plan.h"

namespace eventgan {

/// A planned shard without its samples.
struct ShardOutline {
  std::string name;
  int source = 0;  ///< index into the manifest's sources
  ImageSize volume_size;
  int samples = 0;
  bool size_unknown = false;  ///< see PlannedShard
  bool operator==(const ShardOutline&) const = default;
};

/// A plan without its samples: all that `status` and `finalize` need, small for any number of
/// pairs.
struct PlanOutline {
  std::string name;
  std::string manifest_text;
  std::map<std::string, std::string> fingerprint;
  std::vector<SourceSummary> sources;
  std::vector<ShardOutline> shards;

  std::int64_t sample_count() const;
};

ShardOutline outline_of(const PlannedShard& shard);
std::vector<ShardOutline> outlines_of(const std::vector<const PlannedShard*>& shards);
PlanOutline outline_of(const Plan& plan);

/// Reads plan.json and skips its samples, which stand on lines of their own: a million pairs take
/// about as long as reading the file. Throws std::runtime_error as parse_plan does; faults inside a
/// sample's line are not seen.
PlanOutline read_plan_outline(std::istream& stream, const std::string& name);

}  // namespace eventgan
