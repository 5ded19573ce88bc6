#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "manifests/values/shard.h"

namespace eventgan {

/// A shard that a view shows, as its commit record tells.
struct ViewShard {
  std::string split;
  CommitRecord record;
};

/// Rows first .. first + count - 1.
struct RowRange {
  std::int64_t first = 0;
  std::int64_t count = 0;
  bool operator==(const RowRange&) const = default;
};

/// A shard with its place in a view.
struct PlacedShard {
  ViewShard shard;
  RowRange samples;
  RowRange boxes;
  RowRange persons;
};

struct SplitRange {
  std::string name;
  RowRange samples;
  bool operator==(const SplitRange&) const = default;
};

/// Which row of a view each row of its shards becomes, and the columns that follow from the commit
/// records alone. N samples.
struct ViewLayout {
  std::vector<PlacedShard> shards;
  std::vector<SplitRange> splits;
  std::vector<std::int64_t> box_offsets{0};     ///< [N + 1]
  std::vector<std::int64_t> person_offsets{0};  ///< [N + 1]
  std::vector<std::uint8_t> valid;              ///< [N] 1, or 0 = quarantined

  std::int64_t sample_count() const { return static_cast<std::int64_t>(valid.size()); }
};

/// Puts shards one after the other: splits in the order of their first shard, so that each split is
/// one range of rows; the shards of a split in the order given. Throws std::runtime_error naming
/// the shard if its commit record's numbers of rows do not go with its number of samples.
ViewLayout lay_out_view(std::vector<ViewShard> shards);

/// Shards that are alike (dataset kind, volume shape, label names), read as one.
struct DatasetView {
  std::string group;   ///< name of its group in the file; empty: the file's root
  ShardHeader header;  ///< of any of its shards; what differs between them is not looked at
  ViewLayout layout;   ///< at least one sample
};

/// What a published view is.
struct ViewReceipt {
  std::string sha256;  ///< hex
  std::int64_t size_bytes = 0;
};

/// Writes `target`, an HDF5 file in which the shards beside it read as one dataset
/// (manifests/guides/shard_format.md, "The whole dataset"): every column is a virtual dataset over
/// the shards', but for the offsets and `valid`, which follow from the commit records. No shard is
/// opened. The same views give the same bytes; the file is published whole (atomic_file.h).
/// `views`: at least one; more than one must all have groups, each its own.
///
/// Throws std::runtime_error naming the path. Thread safe.
ViewReceipt write_dataset_view(const std::filesystem::path& target,
                               const std::vector<DatasetView>& views);

}  // namespace eventgan
