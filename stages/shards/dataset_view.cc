#include "stages/shards/dataset_view.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "manifests/files/sha256.h"
#include "stages/base/hdf5/hdf5.h"
#include "stages/base/hdf5/hdf5_output_file.h"
#include "stages/shards/detail/shard_objects.h"
#include "stages/shards/shard_tables.h"

namespace eventgan {
namespace {

/// Adds the rows of a shard's samples behind those before, and gives their range.
RowRange append_offsets(const CommitRecord& record, const std::vector<std::int32_t>& rows,
                        const char* what, std::vector<std::int64_t>& offsets) {
  if (std::ssize(rows) != record.samples) {
    throw std::runtime_error("expected numbers of " + std::string(what) + " for " +
                             std::to_string(record.samples) + " samples, got " +
                             std::to_string(rows.size()) + ", in the commit record of " +
                             record.shard);
  }
  const std::int64_t first = offsets.back();
  for (const std::int32_t count : rows) {
    if (count < 0) {
      throw std::runtime_error("expected 0 or more " + std::string(what) + " of a sample, got " +
                               std::to_string(count) + ", in the commit record of " + record.shard);
    }
    offsets.push_back(offsets.back() + count);
  }
  return {first, offsets.back() - first};
}

RowRange append_valid(const CommitRecord& record, std::vector<std::uint8_t>& valid) {
  const std::size_t first = valid.size();
  valid.resize(first + static_cast<std::size_t>(record.samples), 1);
  for (const QuarantinedSample& sample : record.quarantined) {
    if (sample.slot < 0 || sample.slot >= record.samples) {
      throw std::runtime_error("expected a slot below " + std::to_string(record.samples) +
                               ", got " + std::to_string(sample.slot) +
                               ", in the commit record of " + record.shard);
    }
    valid[first + static_cast<std::size_t>(sample.slot)] = 0;
  }
  return {static_cast<std::int64_t>(first), record.samples};
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
    const CommitRecord& record = shard.record;
    const RowRange samples = append_valid(record, layout.valid);
    const RowRange boxes =
        append_offsets(record, record.contents.boxes, "boxes", layout.box_offsets);
    const RowRange persons =
        append_offsets(record, record.contents.persons, "persons", layout.person_offsets);
    if (layout.splits.empty() || layout.splits.back().name != shard.split) {
      layout.splits.push_back({shard.split, {samples.first, 0}});
    }
    layout.splits.back().samples.count += samples.count;
    layout.shards.push_back({std::move(shard), samples, boxes, persons});
  }
  return layout;
}

namespace {

/// Rows first .. first + count - 1 of a virtual dataset: all rows of the source in `file`.
struct MappedRows {
  std::string file;
  hsize_t first = 0;
  hsize_t count = 0;  ///< > 0
};

/// What a column of numbers reads as where its shard is not there: NaN, or an integer with all bits
/// set (-1, 255). HDF5 1.10 has no such value for text, which reads as empty.
template <class Number>
Number missing_value() {
  if constexpr (std::is_same_v<Number, Half>) {
    return kHalfNan;
  } else if constexpr (std::is_floating_point_v<Number>) {
    return std::numeric_limits<Number>::quiet_NaN();
  } else {
    return static_cast<Number>(-1);
  }
}

/// Creates the virtual dataset `path` below `location`, which reads as the datasets at `source` in
/// other files. `dims`: its shape, of which all but the rows are those of every source too; it has
/// elements. File names are relative to the folder of the file that holds `location`. `missing`: an
/// element of `type`, see missing_value; none if null. Gives the open dataset. Throws Hdf5Error.
Hdf5Handle create_virtual_dataset(hid_t location, const std::string& path,
                                  const std::string& source, hid_t type, const Dims& dims,
                                  const std::vector<MappedRows>& rows, const void* missing) {
  const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
  if (missing != nullptr) checked(H5Pset_fill_value(creation, type, missing), "fill", path);
  const Hdf5Handle space = space_of(dims, path);
  Dims start(dims.size(), 0);
  Dims count = dims;
  for (const MappedRows& range : rows) {
    start[0] = range.first;
    count[0] = range.count;
    checked(
        H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
        "select in", path);
    checked(
        H5Pset_virtual(creation, space, range.file.c_str(), source.c_str(), space_of(count, path)),
        "map", path);
  }
  return create_dataset(location, path, type, space_of(dims, path), creation);
}

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

bool has_column(const CommitRecord& record, const ColumnSpec& spec) {
  return !spec.optional() || std::ranges::count(record.contents.optional_columns, spec.path) > 0;
}

/// The view's columns in its group.
class ViewColumns {
 public:
  ViewColumns(hid_t group, const DatasetView& view) : group_(group), view_(view) {}

  void write() {
    write_volume();
    // What is in these tables is written; the columns that are empty in them are mapped.
    ShardTables known;
    known.boxes.offsets = view_.layout.box_offsets;
    known.poses.offsets = view_.layout.person_offsets;
    known.valid = view_.layout.valid;
    visit_columns(std::as_const(known), view_.header,
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
    const ColumnSpec spec = volume_column(header.volume);
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
    if (spec.optional() && rows.empty()) return;
    const Dims shape = dims(spec);
    const bool has_elements = std::ranges::count(shape, hsize_t{0}) == 0;
    if (!column.empty() || !has_elements) {
      return write_dataset(group_, path, column, shape, view_.header.deflate_level);
    }
    const auto create = [&](const void* missing) {
      create_virtual_dataset(group_, path, spec.path, element_type<Element>(), shape, rows, missing)
          .close(path);
    };
    if constexpr (is_number<Element>) {
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
      if (range.count == 0 || !has_column(placed.shard.record, spec)) continue;
      rows.push_back({placed.shard.record.shard, static_cast<hsize_t>(range.first),
                      static_cast<hsize_t>(range.count)});
    }
    return rows;
  }

  hid_t group_;
  const DatasetView& view_;
};

/// Creates the volume and all columns of a shard (shard_tables.h) in the view's group, which has
/// the groups they are in. Every column goes one of two ways: what the layout knows from the
/// commit records is written, the rest is mapped; an optional one only if some shard has it. 4,000
/// shards take about 1 s and 15 MB. Throws Hdf5Error.
void write_view_columns(hid_t group, const DatasetView& view) { ViewColumns(group, view).write(); }

/// Groups `shards` and `splits`: which rows are whose.
template <class Range, class NameOf>
void write_ranges(hid_t view, const std::string& group, const std::vector<Range>& ranges,
                  NameOf name_of, int deflate_level) {
  std::vector<std::string> names;
  std::vector<std::int64_t> first;
  std::vector<std::int64_t> rows;
  for (const Range& range : ranges) {
    names.push_back(name_of(range));
    first.push_back(range.samples.first);
    rows.push_back(range.samples.count);
  }
  create_group(view, group).close(group);
  const Dims dims{ranges.size()};
  write_dataset(view, group + "/name", names, dims, deflate_level);
  write_dataset(view, group + "/first", first, dims, deflate_level);
  write_dataset(view, group + "/rows", rows, dims, deflate_level);
}

void write_view(hid_t group, const DatasetView& view) {
  const int level = view.header.deflate_level;
  write_attribute(group, "dataset", view.header.dataset);
  write_ranges(
      group, "splits", view.layout.splits, [](const SplitRange& split) { return split.name; },
      level);
  write_ranges(
      group, "shards", view.layout.shards,
      [](const PlacedShard& placed) { return placed.shard.record.shard; }, level);
  create_groups(group);
  write_view_columns(group, view);
  std::vector<std::string> optional_columns;
  for (const PlacedShard& placed : view.layout.shards) {
    const auto& columns = placed.shard.record.contents.optional_columns;
    optional_columns.insert(optional_columns.end(), columns.begin(), columns.end());
  }
  describe_columns(group, view.header, optional_columns);
}

constexpr char kViewFormat[] = "eventgan-view";
constexpr FormatVersion kViewFormatVersion{1, 0};

void write_file(hid_t file, const std::vector<DatasetView>& views) {
  std::vector<std::string> names;
  for (const DatasetView& view : views) names.push_back(view.group.empty() ? "/" : view.group);
  write_attribute(file, "format", std::string(kViewFormat));
  write_attribute(file, "format_version", to_string(kViewFormatVersion));
  write_attribute(file, "views", names);
  describe_origin(file, views.front().header);
  for (const DatasetView& view : views) {
    if (view.group.empty()) {
      write_view(file, view);
    } else {
      Hdf5Handle group = create_group(file, view.group);
      write_view(group, view);
      group.close(view.group);
    }
  }
}

}  // namespace

ViewReceipt write_dataset_view(const std::filesystem::path& target,
                               const std::vector<DatasetView>& views) {
  if (views.empty()) throw std::invalid_argument("expected at least one view, got none");
  Hdf5OutputFile file(target);
  try {
    file.write([&] {
      write_file(file.id(), views);
      file.close();
    });
  } catch (const Hdf5Error& error) {
    throw std::runtime_error(target.string() + ": " + error.what());
  }
  AtomicFile& output = file.output();
  output.sync();
  ViewReceipt receipt{sha256_of_file(output.temporary()),
                      static_cast<std::int64_t>(std::filesystem::file_size(output.temporary()))};
  output.publish();
  return receipt;
}

}  // namespace eventgan
