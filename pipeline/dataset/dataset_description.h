#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "manifests/documents/format_version.h"
#include "manifests/values/job.h"
#include "manifests/values/shard.h"
#include "pipeline/folder/amendments.h"
#include "pipeline/folder/output_folder.h"
#include "pipeline/folder/shard_scan.h"
#include "stages/shards/dataset_view.h"

namespace eventgan {

inline constexpr char kDatasetFormat[] = "eventgan-dataset";
inline constexpr FormatVersion kDatasetVersion{1, 0};

/// What a dataset is put together from.
struct DatasetParts {
  FrozenOutline frozen;
  JobManifest manifest;  ///< that of the run that froze the plan
  std::vector<Amendment> amendments;
  std::vector<ShardState> done;        ///< in plan order
  std::vector<ShardState> missing;     ///< the plan's other shards, in plan order
  std::map<int, ShardHeader> headers;  ///< by source: of its first shard that is sound

  const SourceSpec& source_of(const ShardOutline& shard) const {
    return manifest.sources.at(static_cast<std::size_t>(shard.source));
  }
};

/// Puts together what is known of an output folder whose plan is `frozen`. `shards`: each shard of
/// the plan, from a scan that has read it. Of one shard of each source the header is read: of the
/// first that is sound, so that its bytes are its commit record's; and of each sound one whose size
/// was unknown at planning: its outline then has the file's, that of one that is not sound {0, 0}.
/// Throws std::runtime_error naming the file if the plan's manifest or such a shard is not as it
/// should be.
DatasetParts read_dataset_parts(const std::filesystem::path& folder, FrozenOutline frozen,
                                std::vector<ShardState> shards);

/// The same of what is there, by the commit records alone, for a look at it: no shard is hashed, so
/// this must run where a damaged one may be opened (read_apart). Throws InputError too, if there is
/// no plan or no shard that is done.
DatasetParts read_dataset_parts(const std::filesystem::path& folder);

/// The shards that are done, those that are alike together: of one kind of dataset, one size of
/// volumes, one schema of labels. Views come in the order of their first shard. A single one stands
/// at the file's root; of several each has a group named after dataset and size,
/// "kitti_object-375x1242" (and "-2", "-3"... where schemas differ). Throws as lay_out_view does.
std::vector<DatasetView> views_of(const DatasetParts& parts);

/// Sums over the shards of a dataset, or of a part of it. Boxes, persons and gaps of quarantined
/// samples count.
struct DatasetCounts {
  int shards = 0;
  std::int64_t samples = 0;
  std::int64_t valid = 0;
  std::int64_t boxes = 0;
  std::int64_t persons = 0;
  std::int64_t size_bytes = 0;                  ///< of the shards' files
  std::map<std::string, std::int64_t> classes;  ///< boxes by class name; only names that occur
  std::map<int, std::int64_t> gaps;             ///< samples by gap in frames

  std::int64_t quarantined() const { return samples - valid; }
  bool operator==(const DatasetCounts&) const = default;
};

/// "10 samples, 2 of them quarantined, 6 boxes, 1 person with joints".
std::string contents_text(const DatasetCounts& counts);

/// Adds what a shard holds.
void add(const CommitRecord& record, DatasetCounts& counts);

/// The text of dataset.json (manifests/guides/shard_format.md, "The whole dataset"): what the
/// dataset is, without any time or place, so that the same shards give the same bytes. Canonical
/// JSON: sorted keys, two-space indent, newline at the end. `parts` has at least one shard that is
/// done; `receipt` is the view file's. Throws std::runtime_error if the frozen manifest is no JSON.
std::string describe_dataset(const DatasetParts& parts, const std::vector<DatasetView>& views,
                             const ViewReceipt& receipt);

/// What dataset.json must be beside the view that is in the folder.
std::string describe_present_view(const std::filesystem::path& folder, const DatasetParts& parts);

/// The same before there is a view: without "view".
std::string describe_dataset(const DatasetParts& parts);

/// What is in a folder, for a person: how much of it is done, counts by source, volumes, labels by
/// class, gaps, and its shards, of very many the first. Lines, each ended. `parts` as above.
std::string dataset_text(const DatasetParts& parts);

}  // namespace eventgan
