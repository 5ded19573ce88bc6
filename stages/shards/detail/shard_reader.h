#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/values/shard.h"
#include "stages/base/hdf5/hdf5.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// A shard open for reading, with everything in memory but the volumes.
struct ShardFile {
  Hdf5Handle file;
  Hdf5Handle volume;
  bool has_own_filters = false;  ///< the volumes' are those that decode_chunk undoes
  ShardHeader header;
  ShardTables tables;
};

/// Which columns to read.
enum class Columns {
  kAll,
  kCounted,  ///< those that a commit record's numbers are counts of, and the ids of samples; of
             ///< images one element, for that they are there
  kOverview  ///< see read_overview
};

/// Opens a shard and reads its columns. Every dataset that is missing, or has another type or shape
/// than the format says, adds a line "PATH: fault" to `faults`; so do offsets that do not ascend
/// from 0. Only if there is no fault the tables are consistent. Throws std::runtime_error naming
/// the file if it cannot be opened, or has no header that makes sense.
ShardFile open_shard(const std::filesystem::path& path, std::vector<std::string>& faults,
                     Columns columns = Columns::kAll);

/// The volume in `slot` as stored: the numbers' bytes, zeros where nothing was written. Throws
/// Hdf5Error, also if a checksum is wrong.
std::vector<std::byte> read_stored_volume(const ShardFile& shard, int slot);

/// The chunk of `slot` after all filters, as it lies in the file; empty if none was written. Throws
/// Hdf5Error, also if a filter was left out of it, or its checksum is wrong.
std::vector<std::byte> read_stored_chunk(const ShardFile& shard, int slot);

}  // namespace eventgan
