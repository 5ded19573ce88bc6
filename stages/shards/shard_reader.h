#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <vector>

#include "manifests/values/shard.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// Reads a shard back, field by field and with every checksum. Errors are std::runtime_error naming
/// the file and the HDF5 path. Thread safety: several threads may have readers and share them; what
/// HDF5 does for them takes turns.
class ShardReader {
 public:
  /// Reads everything but the volumes. Throws InputError if there is no file, std::runtime_error if
  /// the file is not a shard of a version this program knows, or not built as the format says: then
  /// with a line for each fault.
  explicit ShardReader(const std::filesystem::path& file);
  ~ShardReader();
  ShardReader(ShardReader&&) noexcept;

  const ShardHeader& header() const;

  /// Every column as it is stored; consistent, as visit_columns says.
  const ShardTables& tables() const;

  /// The rows of the shard, counted.
  ShardContents contents() const;

  /// Everything about slot `slot` but its volume. `fault` is empty, since it is in the commit
  /// record. Throws std::out_of_range.
  ShardSample sample(int slot) const;

  /// The volume of slot `slot`, decoded to float32 [2 bins, H, W], C order.
  std::vector<float> volume(int slot) const;

  /// The volume's chunk as it lies in the file, for ShardWriter::append: what it was given once;
  /// empty where no volume was written (a quarantined sample).
  std::vector<std::byte> stored_chunk(int slot) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// What tells of many samples which are worth a look. Of `tables` it has the volumes' sums and
/// flags, sample_id, sequence, gaps and label_index, offsets, xyxy, class_id and ignore of boxes,
/// and valid; everything else is empty.
struct ShardOverview {
  ShardHeader header;
  ShardTables tables;
};

/// Reads these columns alone: quick also for shards with many labels. Throws as ShardReader's
/// constructor does. Thread safe, as it is.
ShardOverview read_overview(const std::filesystem::path& file);

}  // namespace eventgan
