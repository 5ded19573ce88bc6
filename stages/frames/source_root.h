#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/faults.h"

namespace eventgan {

/// A source's root folder under both its names: as the manifest writes it, for records and
/// messages, and where it lies on disk. Relative paths have forward slashes. A value.
class SourceRoot {
 public:
  SourceRoot(std::string_view written, const std::filesystem::path& base);

  /// As FrameRef::path writes it; the root itself for "".
  std::string written(std::string_view relative) const;
  std::filesystem::path on_disk(std::string_view relative) const;

  /// Throws InputError if there is no such folder.
  void require_folder(std::string_view relative) const;
  /// True if there is something of that name that is no folder. Whether it can be read shows in
  /// reading it: a file that is there and unreadable must not pass for one that is absent.
  bool has_file(std::string_view relative) const;

  /// Names of the folders, or of the other files, in a folder; sorted. None if it is absent.
  /// Throws InputError if it cannot be listed.
  std::vector<std::string> folders_in(std::string_view relative) const;
  std::vector<std::string> files_in(std::string_view relative) const;

  /// A whole regular file, byte for byte. A fault names the file and the reason.
  Outcome<std::string> read(std::string_view relative) const;
  /// The same, for files without which the source cannot be opened: throws InputError.
  std::string read_or_throw(std::string_view relative) const;

 private:
  std::string written_;
  std::filesystem::path on_disk_;
};

}  // namespace eventgan
