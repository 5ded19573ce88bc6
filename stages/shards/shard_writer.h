#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>

#include "manifests/values/shard.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// What a committed shard is.
struct ShardReceipt {
  std::string sha256;  ///< hex
  std::int64_t size_bytes = 0;
  ShardContents contents;
};

/// The temporary file has gone before it could be renamed. Nobody deletes that of a writer that
/// seems alive, so the writer must have been silent for long: suspended, or cut off from its disk.
class UnfinishedShardLost : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Writes one shard so that it is under its final name whole or not at all, by the steps of
/// atomic_file.h: volumes are written to the temporary as they come, in slot order, and the rows of
/// everything else are kept in memory until `commit`. That closes every HDF5 object and then the
/// file, checking each close, since HDF5 writes most of its own data only then; the close degree
/// SEMI makes a forgotten object an error. Not everything that a write can meet surfaces in an HDF5
/// call: see Hdf5OutputFile. The file is hashed as it is read back after its fsync. The commit
/// record is the caller's next step. A writer destroyed before `commit` deletes its temporary file.
///
/// The same header and samples give the same bytes. Errors (disk full, no permission) are thrown as
/// std::runtime_error that names the path. Thread safety: one writer is for one thread at a time.
class ShardWriter {
 public:
  /// Throws std::invalid_argument for an empty shape or volumes of 4 GiB and more.
  ShardWriter(const std::filesystem::path& folder, const ShardHeader& header);
  ~ShardWriter();
  ShardWriter(const ShardWriter&) = delete;
  ShardWriter& operator=(const ShardWriter&) = delete;

  /// The next slot. `chunk` as VolumeCodec encodes a volume of the header's shape, type and level;
  /// empty for a quarantined sample, whose volume then reads as zeros. Such a sample may come
  /// without `labels`; then no box and no person of its annotation is stored, only the original.
  /// Throws std::logic_error beyond the header's sample count or for labels that do not fit the
  /// schema; after any other error the writer can only be destroyed.
  void append(const ShardSample& sample, std::span<const std::byte> chunk);

  /// Steps 2 to 5. Throws std::logic_error if slots are missing, UnfinishedShardLost if the
  /// temporary file is gone. Once.
  ShardReceipt commit();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace eventgan
