#include "stages/shards/shard_tables.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "stages/shards/detail/shard_objects.h"

namespace eventgan {
namespace {

std::vector<std::int32_t> rows_by_slot(const std::vector<std::int64_t>& offsets) {
  std::vector<std::int32_t> rows;
  for (std::size_t slot = 0; slot + 1 < offsets.size(); ++slot) {
    rows.push_back(static_cast<std::int32_t>(offsets[slot + 1] - offsets[slot]));
  }
  return rows;
}

}  // namespace

ImageSize tile_grid(const ShardHeader& header) {
  const int side = header.tile_px;
  if (side == 0) return {};
  const ImageSize size = header.volume.size;
  return {(size.height + side - 1) / side, (size.width + side - 1) / side};
}

double generated_fraction(const ShardSample& sample) {
  if (sample.tiles.empty()) return 1;
  const auto generated = std::count(sample.tiles.begin(), sample.tiles.end(), 1);
  return static_cast<double>(generated) / static_cast<double>(sample.tiles.size());
}

ColumnSpec volume_column(const VolumeShape& volume) {
  return {
      kVolumePath,
      "float16, float32 or uint8, as the manifest asks. Channels 0..B-1 are of positive polarity, "
      "B..2B-1 of "
      "negative, in time order; values are ≥ 0, in `unit`",
      Rows::kSamples,
      {static_cast<std::size_t>(volume.channels()), static_cast<std::size_t>(volume.size.height),
       static_cast<std::size_t>(volume.size.width)}};
}

ShardContents contents_of(const ShardTables& tables, const ShardHeader& header) {
  ShardContents contents;
  contents.boxes = rows_by_slot(tables.boxes.offsets);
  contents.persons = rows_by_slot(tables.poses.offsets);
  const std::vector<std::string>& names = header.label_schema.class_names;
  for (const std::int32_t id : tables.boxes.class_id) {
    if (id < 0 || static_cast<std::size_t>(id) >= names.size()) continue;
    ++contents.classes[names[static_cast<std::size_t>(id)]];
  }
  for (const std::int32_t gap : tables.pairs.gap_frames) ++contents.gaps[gap];
  visit_columns(tables, header, [&](const ColumnSpec& spec, const auto& column) {
    if (spec.optional() && !column.empty()) contents.optional_columns.push_back(spec.path);
  });
  return contents;
}

std::vector<std::string> features_of(const std::vector<std::string>& optional_columns,
                                     const LabelSchema& schema) {
  std::vector<std::string> features;
  const ShardTables none;
  visit_columns(none, ShardHeader(), [&](const ColumnSpec& spec, const auto&) {
    if (!spec.optional() || std::ranges::count(optional_columns, spec.path) == 0) return;
    if (std::ranges::count(features, spec.feature) == 0) features.emplace_back(spec.feature);
  });
  if (!schema.joint_aliases.empty()) features.emplace_back("joint_aliases");
  return features;
}

std::vector<std::string> unknown_features(const std::vector<std::string>& features) {
  std::vector<std::string> all;
  const ShardTables none;
  visit_columns(none, ShardHeader(),
                [&](const ColumnSpec& spec, const auto&) { all.emplace_back(spec.path); });
  const std::vector<std::string> known = features_of(all, {{}, {}, {""}});
  std::vector<std::string> unknown = features;
  std::erase_if(unknown, [&](const auto& name) { return std::ranges::count(known, name) > 0; });
  return unknown;
}

}  // namespace eventgan
