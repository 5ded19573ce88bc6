#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace eventgan {

/// The names in a folder, each list sorted.
struct FolderListing {
  std::vector<std::string> folders;
  std::vector<std::string> files;  ///< all that is no folder, dangling links too
};

/// Lists a folder, once; nothing if it is absent. Throws InputError if it cannot be listed.
FolderListing list_folder(const std::filesystem::path& folder);

}  // namespace eventgan
