#pragma once

#include <filesystem>
#include <vector>

namespace eventgan {

/// Deletes the temporary files in `folder` (not below it) whose writer was a process of this host
/// that is no longer alive. Those of other hosts and of living processes stay, as does every other
/// file. Gives the deleted paths, sorted. Throws std::runtime_error naming the folder if it cannot
/// be listed.
std::vector<std::filesystem::path> remove_stale_temporaries(const std::filesystem::path& folder);

}  // namespace eventgan
