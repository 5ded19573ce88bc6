#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/shards/shard_reader.h"

namespace eventgan {

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
