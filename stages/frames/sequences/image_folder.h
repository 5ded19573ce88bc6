#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "stages/frames/numbered_sequence.h"

namespace eventgan {

/// The extension with its dot, in small letters: ".json" for "a.JSON"; empty if there is none.
std::string lower_extension(const std::filesystem::path& file);

/// Orders names as people do: runs of digits by their value ("img2" before "img10"), all else by
/// its bytes. Names that differ only in leading zeros ("1", "01") are ordered by their bytes, so
/// the order is total.
bool natural_less(std::string_view a, std::string_view b);

/// What lies in a folder of images with any names.
struct ImageFolder {
  /// If all names are one prefix and then digits, each image has its number, and a missing number
  /// is a missing frame. Otherwise they are counted from 0 in natural order.
  NumberedSequence frames;
  /// The .json files (also .JSON) beside them: name without extension to name. Of two that differ
  /// only in the extension's letters, the first by name counts.
  std::map<std::string, std::string> sidecars;
  std::vector<std::string> folders;  ///< names of the folders in it, sorted
  /// Other files, images and .json files that give way to another of their name, and what no plan
  /// can name (FolderListing::unnameable); sorted.
  std::vector<std::string> left_out;
};

/// Lists `folder`, passing over hidden entries. Of two images of one name the one of the
/// extension that comes first in kImageExtensions counts. An absent folder is empty. Throws
/// InputError if it cannot be listed.
ImageFolder list_image_folder(const std::filesystem::path& folder);

}  // namespace eventgan
