#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace eventgan {

/// What `eventgan verify` found.
struct FolderCheck {
  std::vector<std::string> faults;  ///< one line each
  int shards = 0;                   ///< shards of the plan that were looked at
  long long samples = 0;
  long long valid = 0;
};

/// Checks a whole output folder: the plan, a marker for every shard of it, each shard's structure,
/// counts, checksums and values, and that nothing else looks like a shard. Throws InputError if the
/// folder has no plan.
FolderCheck verify_folder(const std::filesystem::path& folder);

}  // namespace eventgan
