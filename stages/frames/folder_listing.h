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

/// What a note says of some files: "2 labels without a picture in clip: a.json, b.json". After
/// twenty names "..." stands for the others. `what` is what they are, and where.
std::string counted(const std::vector<std::string>& names, const std::string& what);

/// Lists a folder, once; nothing if it is absent. Throws InputError if it cannot be listed.
FolderListing list_folder(const std::filesystem::path& folder);

}  // namespace eventgan
