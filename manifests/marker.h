#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan {

/// A sample that a shard keeps a slot for but no volume.
struct QuarantinedSample {
  int slot = 0;
  std::string sample_id;
  std::string reason;
  bool operator==(const QuarantinedSample&) const = default;
};

/// The file SHARD.json beside a shard: written after the shard is whole and in place, so its
/// existence is what says "done" (DESIGN section 6). A shard is done if its marker parses, names
/// the plan, and the shard has the marker's size.
struct ShardMarker {
  std::string shard;      ///< the shard's file name
  std::string plan_hash;  ///< hex SHA-256
  std::string sha256;     ///< of the shard's bytes, hex
  std::int64_t size_bytes = 0;
  int samples = 0;
  int valid = 0;
  std::vector<QuarantinedSample> quarantined;
  std::map<std::string, double> stage_seconds;  ///< busy time by stage
  bool operator==(const ShardMarker&) const = default;
};

/// Canonical JSON (sorted keys, two-space indent, newline at the end).
std::string to_json(const ShardMarker& marker);

/// Throws std::runtime_error listing every fault ("PATH: $.key: expected X, got Y"); strict as
/// manifests are.
ShardMarker parse_marker(std::string_view text, const std::string& name);

/// Name of the marker that belongs to a shard file: the same name with ".h5" replaced by ".json".
std::string marker_name(const std::string& shard_name);

}  // namespace eventgan
