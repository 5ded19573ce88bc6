#pragma once

#include <string>
#include <vector>

#include "stages/shards/shard_contents.h"

namespace eventgan {

/// What a marker says of its shard's rows that is not so: lines "expected X, got Y" with X the
/// marker's, at most one for each field, without the file's name; empty if sound.
std::vector<std::string> contents_faults(const ShardContents& marker, const ShardContents& shard);

}  // namespace eventgan
