#pragma once

#include <filesystem>
#include <vector>

namespace eventgan {

/// Deletes the temporary files in `folder` (not below it) whose writers are dead, as is_stale
/// (unfinished_files.h) tells; every other file stays. Gives the deleted paths, sorted. Throws
/// std::runtime_error naming the folder if it cannot be listed.
std::vector<std::filesystem::path> remove_stale_temporaries(const std::filesystem::path& folder);

}  // namespace eventgan
