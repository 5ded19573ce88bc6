#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "manifests/marker.h"

namespace eventgan {

/// A shard that a view shows, as its marker tells.
struct ViewShard {
  std::string split;
  ShardMarker marker;
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

/// Which row of a view each row of its shards becomes, and the columns that follow from the markers
/// alone. N samples.
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
/// the shard if its marker's numbers of rows do not go with its number of samples.
ViewLayout lay_out_view(std::vector<ViewShard> shards);

}  // namespace eventgan
