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

/// A quarantined sample and the shard it is of.
struct QuarantinedSlot {
  std::string shard;  ///< the shard's file name
  int slot = 0;
  std::string sample_id;
  std::string reason;
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
  /// Rows of /labels/boxes and /labels/poses by slot, quarantined samples included: with these the
  /// whole dataset's offsets follow from the markers alone.
  std::vector<std::int32_t> boxes;
  std::vector<std::int32_t> persons;
  std::map<std::string, std::int64_t> classes;  ///< boxes by class name; only names that occur
  std::map<int, std::int64_t> gaps;             ///< samples by gap in frames
  std::vector<std::string> optional_columns;    ///< paths of the optional columns the shard has
  std::map<std::string, double> stage_seconds;  ///< busy time by stage
  double wall_seconds = 0;  ///< since the writer's previous commit, or the start of its run
  bool operator==(const ShardMarker&) const = default;
};

/// Canonical JSON (sorted keys, two-space indent but an array of numbers on one line, newline at
/// the end). Throws std::invalid_argument for seconds that are negative or no number.
std::string to_json(const ShardMarker& marker);

/// Throws std::runtime_error listing every fault ("PATH: $.key: expected X, got Y"); strict as
/// manifests are.
ShardMarker parse_marker(std::string_view text, const std::string& name);

/// Name of the marker that belongs to a shard file: the same name with ".h5" replaced by ".json".
std::string marker_name(const std::string& shard_name);

}  // namespace eventgan
