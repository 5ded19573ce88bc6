#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "stages/frames/find_source.h"

namespace eventgan {

/// A manifest for a dataset that was found, and what a person should know of the two.
struct ManifestDraft {
  std::string text;  ///< the manifest, with comments
  /// What was found, what is missing, and what speaks against it ("warning: ..."), a line each.
  std::vector<std::string> findings;
  std::vector<std::string> notes;  ///< Dataset::notes()
  bool has_pairs = false;          ///< false: no labelled frame has a paired frame at any gap
};

/// Opens the dataset, counts its labelled frames and their paired frames, and writes a manifest for
/// it: gaps, size and preset as manifests/examples have them, gaps without any paired frame left
/// out; name and output folder after the folder or video that was found. Of folders of images some
/// are looked at, whether they can be sequences. The manifest will lie in `folder`; its paths start
/// there if `relative`, else they are absolute. What it reads is what `convert` would read from it.
/// Throws as open_dataset does, and UsageError for a path that is not UTF-8, which no manifest can
/// name.
ManifestDraft draft_manifest(const FoundSource& found, const std::filesystem::path& folder,
                             bool relative);

}  // namespace eventgan
