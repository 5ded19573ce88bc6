#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "stages/shards/shard_columns.h"
#include "stages/shards/shard_objects_internal.h"
#include "stages/shards/view/view_columns_internal.h"
#include "stages/shards/view/virtual_dataset_internal.h"

namespace eventgan {
namespace {

constexpr char kVolumePath[] = "/events/volume";
constexpr std::uint16_t kHalfNan = 0x7e00;

/// A shard's path, from the view's group instead of the root.
std::string below_group(const char* path) { return path + 1; }

const RowRange& rows_of(const PlacedShard& shard, Rows rows) {
  switch (rows) {
    case Rows::kBoxes:
      return shard.boxes;
    case Rows::kPersons:
      return shard.persons;
    case Rows::kSamples:
    case Rows::kOffsets:
      break;
  }
  return shard.samples;
}

bool has_column(const ShardMarker& marker, const ColumnSpec& spec) {
  return !spec.optional || std::ranges::count(marker.optional_columns, spec.path) > 0;
}

/// The view's columns in its group.
class ViewColumns {
 public:
  ViewColumns(hid_t group, const DatasetView& view) : group_(group), view_(view) {}

  void write() {
    write_volume();
    // What stands in these tables is written; the columns that are empty in them are mapped.
    ShardTables known;
    known.boxes.offsets = view_.layout.box_offsets;
    known.poses.offsets = view_.layout.person_offsets;
    known.valid = view_.layout.valid;
    visit_columns(std::as_const(known), view_.header.label_schema.joint_names.size(),
                  [&](const ColumnSpec& spec, const auto& column) { add(spec, column); });
  }

 private:
  void write_volume() {
    const ShardHeader& header = view_.header;
    const float nan = missing_value<float>();
    const auto byte = missing_value<std::uint8_t>();
    const void* missing = header.dtype == StoredType::kFloat32 ? static_cast<const void*>(&nan)
                          : header.dtype == StoredType::kFloat16
                              ? static_cast<const void*>(&kHalfNan)
                              : static_cast<const void*>(&byte);
    const ColumnSpec spec{kVolumePath,
                          Rows::kSamples,
                          {static_cast<std::size_t>(header.volume.channels()),
                           static_cast<std::size_t>(header.volume.size.height),
                           static_cast<std::size_t>(header.volume.size.width)}};
    Hdf5Handle volume =
        create_virtual_dataset(group_, below_group(kVolumePath), kVolumePath,
                               volume_type(header.dtype), dims(spec), mapped_rows(spec), missing);
    describe_volume(volume, header);
    volume.close(kVolumePath);
  }

  template <class Element>
  void add(const ColumnSpec& spec, const std::vector<Element>& column) {
    const std::string path = below_group(spec.path);
    const std::vector<MappedRows> rows = mapped_rows(spec);
    if (spec.optional && rows.empty()) return;
    const Dims shape = dims(spec);
    const bool has_elements = std::ranges::count(shape, hsize_t{0}) == 0;
    if (!column.empty() || !has_elements) {
      return write_dataset(group_, path, column, shape, view_.header.deflate_level);
    }
    const auto create = [&](const void* missing) {
      create_virtual_dataset(group_, path, spec.path, element_type<Element>(), shape, rows, missing)
          .close(path);
    };
    if constexpr (std::is_arithmetic_v<Element>) {
      const auto missing = missing_value<Element>();
      create(&missing);
    } else {
      create(nullptr);
    }
  }

  Dims dims(const ColumnSpec& spec) const {
    const RowRange last = rows_of(view_.layout.shards.back(), spec.rows);
    Dims dims{static_cast<hsize_t>(last.first + last.count + (spec.rows == Rows::kOffsets))};
    dims.insert(dims.end(), spec.inner.begin(), spec.inner.end());
    return dims;
  }

  std::vector<MappedRows> mapped_rows(const ColumnSpec& spec) const {
    std::vector<MappedRows> rows;
    for (const PlacedShard& placed : view_.layout.shards) {
      const RowRange range = rows_of(placed, spec.rows);
      if (range.count == 0 || !has_column(placed.shard.marker, spec)) continue;
      rows.push_back({placed.shard.marker.shard, static_cast<hsize_t>(range.first),
                      static_cast<hsize_t>(range.count)});
    }
    return rows;
  }

  hid_t group_;
  const DatasetView& view_;
};

}  // namespace

void write_view_columns(hid_t group, const DatasetView& view) { ViewColumns(group, view).write(); }

}  // namespace eventgan
