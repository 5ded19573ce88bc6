#include "stages/frames/folder_listing.h"

#include <algorithm>
#include <system_error>

#include "manifests/faults.h"

namespace eventgan {

std::string counted(const std::vector<std::string>& names, const std::string& what) {
  constexpr std::size_t kNamed = 20;
  std::string text = std::to_string(names.size()) + " " + what;
  for (std::size_t i = 0; i < std::min(names.size(), kNamed); ++i) {
    text += (i == 0 ? ": " : ", ") + names[i];
  }
  return names.size() > kNamed ? text + ", ..." : text;
}

FolderListing list_folder(const std::filesystem::path& folder) {
  FolderListing listing;
  std::error_code error;
  std::filesystem::directory_iterator entries(folder, error);
  if (error == std::errc::no_such_file_or_directory) return listing;
  for (; !error && entries != std::filesystem::directory_iterator(); entries.increment(error)) {
    std::error_code ignored;  // a dangling link is a file that cannot be read later
    auto& names = entries->is_directory(ignored) ? listing.folders : listing.files;
    names.push_back(entries->path().filename().string());
  }
  if (error) {
    throw InputError("expected a readable folder, got '" + error.message() + "', in " +
                     folder.string());
  }
  std::ranges::sort(listing.folders);
  std::ranges::sort(listing.files);
  return listing;
}

}  // namespace eventgan
