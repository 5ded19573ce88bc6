#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "manifests/labels.h"
#include "manifests/marker.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {

/// What a marker says of its shard's rows, so that a whole dataset can be laid out from markers.
struct ShardContents {
  std::vector<std::int32_t> boxes;              ///< rows of /labels/boxes by slot
  std::vector<std::int32_t> persons;            ///< rows of /labels/poses by slot
  std::map<std::string, std::int64_t> classes;  ///< boxes by class name; only names that occur
  std::map<int, std::int64_t> gaps;             ///< samples by gap in frames
  std::vector<std::string> optional_columns;    ///< paths, in the order of the columns
  bool operator==(const ShardContents&) const = default;
};

/// Counts the rows of consistent tables.
ShardContents contents_of(const ShardTables& tables, const LabelSchema& schema);

/// Puts them into the marker's fields of the same names, and gives those.
void enter(ShardContents contents, ShardMarker& marker);
ShardContents contents_of(const ShardMarker& marker);

}  // namespace eventgan
