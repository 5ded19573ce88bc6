#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/values/job.h"

namespace eventgan {

/// A dataset that was found by looking at a folder. Paths are absolute and normal.
struct FoundSource {
  DatasetKind dataset = DatasetKind::kFrames;
  std::string_view layout;  ///< the manifest's word; empty where the dataset has only one
  std::string_view title;   ///< for a person: "KITTI object"
  std::filesystem::path root;
  std::optional<std::filesystem::path> raw_root, devkit, annotations, sequences;
  /// What is not there and what that costs, or is left out; a line each.
  std::vector<std::string> remarks;
};

/// Finds out which dataset lies at `path` or, if it is none, in a folder of it; `dataset`, if it is
/// given, must be that one. What belongs to it is looked for beside it, too: KITTI raw and the
/// development kit in the two folders above the root and in their folders. Only names are looked
/// at, and the beginnings of lists of people: opening the dataset tells whether it is sound.
///
/// Any folder of images or videos is `frames`, so that this is asked last. Throws InputError if
/// there is nothing at `path`, no such dataset, or more than one.
FoundSource find_source(const std::filesystem::path& path,
                        std::optional<DatasetKind> dataset = std::nullopt);

}  // namespace eventgan
