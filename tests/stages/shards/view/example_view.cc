#include "tests/stages/shards/view/example_view.h"

#include <utility>

#include "manifests/documents/commit_record.h"
#include "manifests/files/atomic_file.h"
#include "tests/stages/shards/example_shard.h"

namespace eventgan::testing {
namespace {

/// The samples in `slots` of `whole` as a shard of their own.
ExampleShard part_of(const ExampleShard& whole, const std::vector<std::size_t>& slots,
                     const std::string& name, const std::string& split) {
  ExampleShard part{whole.header, {}, {}};
  part.header.name = name;
  part.header.split = split;
  part.header.sample_count = static_cast<int>(slots.size());
  for (const std::size_t slot : slots) {
    part.samples.push_back(whole.samples[slot]);
    part.samples.back().sample_id += "/" + name.substr(5, 7);
    part.volumes.push_back(whole.volumes[slot]);
  }
  return part;
}

ViewShard write(const std::filesystem::path& folder, const ExampleShard& shard) {
  CommitRecord record = write_shard(folder, shard);
  write_file_atomically(folder / commit_record_name(record.shard), to_json(record));
  return {shard.header.split, std::move(record)};
}

}  // namespace

DatasetView write_example_view_shards(const std::filesystem::path& folder, StoredType type,
                                      const std::string& group) {
  const ExampleShard whole = example_shard(type);
  return {
      group, whole.header,
      lay_out_view(
          {write(folder, part_of(whole, {0, 1, 2, 3, 4}, "demo-train-00000-of-00002.h5", "train")),
           write(folder, part_of(whole, {3, 4}, "demo-val-00000-of-00001.h5", "val")),
           write(folder, part_of(whole, {1, 3}, "demo-train-00001-of-00002.h5", "train"))})};
}

DatasetView write_unlabelled_view_shard(const std::filesystem::path& folder,
                                        const std::string& group) {
  const ExampleShard whole = unlabelled_shard();
  return {
      group, whole.header,
      lay_out_view({write(folder, part_of(whole, {0}, "other-train-00000-of-00001.h5", "train"))})};
}

}  // namespace eventgan::testing
