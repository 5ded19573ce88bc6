#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "stages/frames/find_source.h"
#include "stages/frames/source_folders.h"

namespace eventgan {

/// JSON files and tables, which may label all images below a folder. Each folder is listed once:
/// one is above many places.
class WholeFiles {
 public:
  const std::vector<std::filesystem::path>& in(const std::filesystem::path& folder,
                                               std::string_view extension);

 private:
  std::map<std::filesystem::path, std::map<std::string_view, std::vector<std::filesystem::path>>>
      listed_;  ///< by extension
};

/// Images and folders of images, or videos, as a source has them.
struct FoundFrames {
  std::filesystem::path root;
  std::vector<std::string> folders;  ///< with images, or with img1 where MOT's labels are
  std::set<std::string> stems;       ///< of the images and videos right in the root
  WholeFiles* files;
};

/// The first bytes of a file, where a format shows.
std::string beginning_of(const std::filesystem::path& file);

/// Whether the name that a label file has for an image is one of these frames.
bool is_among(const FoundFrames& frames, const std::filesystem::path& name);

/// Names of a folder's files with that extension, in small letters; no hidden ones.
std::vector<std::filesystem::path> names_with(const FolderListing& listing,
                                              std::string_view extension);

/// The split that a folder's name states, in letters of any case: "val" of "valid" and of
/// "VAL2017"; empty if none.
std::string_view split_of(std::string name);

/// Looks for labels of one's own of the frames in found.root, or in a folder of images in it
/// (LabelReader::find). Sets root and labels, and remarks on labels and on folders of images that
/// are there and left out. Where train and val or test have a folder each, with labels of its own,
/// each is a source with its split, else it is one. Cannot fail: what cannot be read is not found.
std::vector<FoundSource> find_own_labels(FoundSource found);

}  // namespace eventgan
