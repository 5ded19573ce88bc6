#include "stages/shards/view/view_layout.h"

#include <algorithm>
#include <map>
#include <stdexcept>
#include <utility>

namespace eventgan {
namespace {

/// Adds the rows of a shard's samples behind those before, and gives their range.
RowRange append_offsets(const ShardMarker& marker, const std::vector<std::int32_t>& rows,
                        const char* what, std::vector<std::int64_t>& offsets) {
  if (std::ssize(rows) != marker.samples) {
    throw std::runtime_error("expected numbers of " + std::string(what) + " for " +
                             std::to_string(marker.samples) + " samples, got " +
                             std::to_string(rows.size()) + ", in the marker of " + marker.shard);
  }
  const std::int64_t first = offsets.back();
  for (const std::int32_t count : rows) {
    if (count < 0) {
      throw std::runtime_error("expected 0 or more " + std::string(what) + " of a sample, got " +
                               std::to_string(count) + ", in the marker of " + marker.shard);
    }
    offsets.push_back(offsets.back() + count);
  }
  return {first, offsets.back() - first};
}

RowRange append_valid(const ShardMarker& marker, std::vector<std::uint8_t>& valid) {
  const std::size_t first = valid.size();
  valid.resize(first + static_cast<std::size_t>(marker.samples), 1);
  for (const QuarantinedSample& sample : marker.quarantined) {
    if (sample.slot < 0 || sample.slot >= marker.samples) {
      throw std::runtime_error("expected a slot below " + std::to_string(marker.samples) +
                               ", got " + std::to_string(sample.slot) + ", in the marker of " +
                               marker.shard);
    }
    valid[first + static_cast<std::size_t>(sample.slot)] = 0;
  }
  return {static_cast<std::int64_t>(first), marker.samples};
}

}  // namespace

ViewLayout lay_out_view(std::vector<ViewShard> shards) {
  std::map<std::string, std::size_t> order;  // of the splits
  for (const ViewShard& shard : shards) order.try_emplace(shard.split, order.size());
  std::stable_sort(shards.begin(), shards.end(), [&](const ViewShard& a, const ViewShard& b) {
    return order.at(a.split) < order.at(b.split);
  });

  ViewLayout layout;
  for (ViewShard& shard : shards) {
    const ShardMarker& marker = shard.marker;
    const RowRange samples = append_valid(marker, layout.valid);
    const RowRange boxes = append_offsets(marker, marker.boxes, "boxes", layout.box_offsets);
    const RowRange persons =
        append_offsets(marker, marker.persons, "persons", layout.person_offsets);
    if (layout.splits.empty() || layout.splits.back().name != shard.split) {
      layout.splits.push_back({shard.split, {samples.first, 0}});
    }
    layout.splits.back().samples.count += samples.count;
    layout.shards.push_back({std::move(shard), samples, boxes, persons});
  }
  return layout;
}

}  // namespace eventgan
