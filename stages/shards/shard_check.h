#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/values/shard.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// What a commit record says of its shard's rows that is not so: lines "expected X, got Y" with X
/// the commit record's, at most one for each field, without the file's name; empty if sound.
std::vector<std::string> contents_faults(const ShardContents& record, const ShardContents& shard);

/// Every fault of a shard, one line each, "FILE: what is wrong"; empty if it is sound. Checks that
/// the commit record's size and SHA-256 are the file's; that every dataset of the format is there
/// with its type and shape; that ragged offsets ascend to the number of rows; that all chunks
/// decode (fletcher32), hold finite values ≥ 0, and agree with the stored statistics; that all the
/// commit record says of the rows (see shard_tables.h) is so. Never throws for a bad file. Thread
/// safe, as ShardReader is.
std::vector<std::string> check_shard(const std::filesystem::path& shard,
                                     const CommitRecord& record);

/// What a commit record says of its shard's rows that is not so: counts, samples in quarantine.
/// Texts "expected X, got Y" with X the shard's, without the file's name. Quick, since only the
/// columns that are counted are read. The shard's bytes must be known to be the commit record's.
/// Throws std::exception if the shard cannot be read. Thread safe, as ShardReader is.
std::vector<std::string> count_faults(const std::filesystem::path& shard,
                                      const CommitRecord& record);

}  // namespace eventgan
