#pragma once

#include <string>

#include "stages/shards/shard_reader.h"

namespace eventgan {

/// What is in a shard, for a person: format, counts, volumes, labels by class, gaps. Lines, each
/// ended.
std::string describe_shard(const ShardReader& reader);

/// Everything about one sample but its volume and the original annotation's text.
std::string describe_sample(const ShardReader& reader, int slot);

/// The same for machines: JSON objects, indented, newline at the end; numbers that are not finite
/// are null.
std::string shard_json(const ShardReader& reader);
std::string sample_json(const ShardReader& reader, int slot);

}  // namespace eventgan
