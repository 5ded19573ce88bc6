#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/faults.h"

namespace eventgan {

/// The names in a folder, each list sorted. What macOS puts beside a file on foreign disks and into
/// archives, "._NAME", is in none of them: it has the name's extension and nothing of its contents.
struct FolderListing {
  std::vector<std::string> folders;
  std::vector<std::string> files;  ///< all that is no folder, dangling links too
  /// "NAME (no UTF-8)" of files and folders with such names, as they come out of other systems'
  /// archives, other bytes written as \xff: plans, shards and JSON cannot name them. And "NAME
  /// (eventgan's output)" of folders (is_own_output).
  std::vector<std::string> passed_over;
};

/// What a note says of some files: "2 files left out in clip: a.json, b.json". After
/// twenty names "..." stands for the others. `noun` and `rest` as in count_text.
std::string counted(const std::vector<std::string>& names, const std::string& noun,
                    const std::string& rest);

/// Lists a folder, once; nothing if it is absent. Throws InputError if it cannot be listed.
FolderListing list_folder(const std::filesystem::path& folder);

/// Whether there is a folder, or a regular file, as far as anybody may see.
bool has_folder(const std::filesystem::path& path);
bool has_file(const std::filesystem::path& path);

/// As list_folder; nothing of what is no folder or cannot be listed, since it is somebody else's.
FolderListing look_into(const std::filesystem::path& folder);

/// ASCII letters made small.
std::string in_small_letters(std::string text);

/// The folder of that name in another, in small or capital letters, as it is written if there is
/// one; empty if there is none.
std::filesystem::path folder_named(const std::filesystem::path& above, std::string_view name);

/// The split that a folder's name states, in letters of any case: "val" of "valid" and of
/// "VAL2017"; empty if none.
std::string_view split_of(std::string name);

/// Whether a folder in it, of what look_into finds, has a name that fits.
template <class Fits>
bool any_folder(const std::filesystem::path& folder, Fits fits) {
  return std::ranges::any_of(look_into(folder).folders, fits);
}

/// A source's root folder under both its names: as the manifest writes it, for records and
/// messages, and where it lies on disk. Relative paths have forward slashes. A value.
class SourceRoot {
 public:
  SourceRoot(std::string_view written, const std::filesystem::path& base);

  /// As FrameRef::path writes it; the root itself for "".
  std::string written(std::string_view relative) const;
  std::filesystem::path on_disk(std::string_view relative) const;

  /// The folder that the root, or what is of that name below it, is in: of "labels" the manifest's
  /// own, of "." or ".." the one above it on disk.
  SourceRoot above(std::string_view relative = "") const;
  /// The name on disk, whatever the manifest writes: "gt" of "." in a manifest in .../gt.
  std::string name() const;

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
  std::filesystem::path base_;
};

}  // namespace eventgan
