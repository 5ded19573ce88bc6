#include "stages/shards/view/dataset_view.h"

#include <cstdint>
#include <stdexcept>

#include "stages/files/sha256.h"
#include "stages/hdf5/hdf5_output_file_internal.h"
#include "stages/shards/shard_objects_internal.h"
#include "stages/shards/view/view_columns_internal.h"

namespace eventgan {
namespace {

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
      [](const PlacedShard& placed) { return placed.shard.marker.shard; }, level);
  create_groups(group);
  write_view_columns(group, view);
  describe_columns(group, view.header);
}

void write_file(hid_t file, const std::vector<DatasetView>& views) {
  std::vector<std::string> names;
  for (const DatasetView& view : views) names.push_back(view.group.empty() ? "/" : view.group);
  write_attribute(file, "format", std::string(kViewFormat));
  write_attribute(file, "format_version", std::int32_t{kViewFormatVersion});
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
