#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "stages/shards/shard_reader.h"

namespace eventgan {

/// Sums over the samples of a shard. Boxes and persons count in quarantined samples too.
struct ShardCounts {
  int valid = 0;
  int empty_volumes = 0;  ///< valid samples with kFlagEmpty
  std::int64_t boxes = 0;
  std::int64_t persons = 0;
  std::map<std::string, std::int64_t> classes;  ///< boxes by class name; only names that occur
  std::map<int, std::int64_t> gaps;             ///< samples by gap in frames
  std::vector<std::string> quarantined;         ///< sample ids in slot order
};

ShardCounts count_shard(const ShardReader& reader);

/// Names of the VolumeFlag bits that are set.
std::vector<std::string> flag_names(std::uint32_t flags);

/// What is in a shard, for a person: format, counts, volumes, labels by class, gaps. Lines, each
/// ended.
std::string describe_shard(const ShardReader& reader);

/// Everything about one sample but its volume and the original annotation's text.
std::string describe_sample(const ShardReader& reader, int slot);

/// The same for machines: JSON objects, indented, newline at the end; numbers that are not finite
/// are null.
std::string shard_json(const ShardReader& reader);

/// Every column of the sample under its name, as it is stored, those of /events in "statistics",
/// and the original annotation; rows of boxes and persons in lists, boxes with the name of their
/// class.
std::string sample_json(const ShardReader& reader, int slot);

}  // namespace eventgan
