#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "manifests/shard.h"
#include "stages/shards/view/view_layout.h"

namespace eventgan {

inline constexpr char kViewFormat[] = "eventgan-view";
inline constexpr int kViewFormatVersion = 1;

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
/// the shards', but for the offsets and `valid`, which follow from the markers. No shard is opened.
/// The same views give the same bytes; the file is published whole (atomic_file.h). `views`: at
/// least one; more than one must all have groups, each its own.
///
/// Throws std::runtime_error naming the path. Thread safe.
ViewReceipt write_dataset_view(const std::filesystem::path& target,
                               const std::vector<DatasetView>& views);

}  // namespace eventgan
