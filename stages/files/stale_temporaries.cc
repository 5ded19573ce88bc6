#include "stages/files/stale_temporaries.h"

#include <system_error>

#include "stages/files/unfinished_files.h"

namespace eventgan {

std::vector<std::filesystem::path> remove_stale_temporaries(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> removed;
  for (const UnfinishedFile& file : unfinished_files(folder)) {
    // Another process may be cleaning as well; what is gone already does not count.
    std::error_code error;
    if (is_stale(file) && std::filesystem::remove(file.path, error)) removed.push_back(file.path);
  }
  return removed;
}

}  // namespace eventgan
