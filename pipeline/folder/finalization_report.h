#pragma once

#include <string>
#include <vector>

#include "pipeline/folder/dataset_description.h"

namespace eventgan {

/// What `finalize` found and did.
struct FinalizationReport {
  std::string folder;
  int shards_planned = 0;
  std::vector<ShardState> missing;  ///< those that are not done, in plan order
  DatasetCounts counts;             ///< of the shards that are done
  std::vector<std::string> notes;   ///< on the inputs (see notes_of)
  int views = 0;                    ///< in dataset.h5
  bool written = false;             ///< dataset.h5 and dataset.json are in place
  bool too_many_faults = false;     ///< the limits for quarantined samples are passed

  bool complete() const { return missing.empty(); }
};

/// A line for each missing shard (of very many the first and how many more), then a few on the
/// whole.
std::string to_text(const FinalizationReport& report);

/// One line of JSON.
std::string to_json(const FinalizationReport& report);

}  // namespace eventgan
