#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/job_manifest.h"

namespace eventgan {

/// Where the parts of an MPII download lie, each path as the manifest writes its beginning.
struct MpiiPlaces {
  std::string annotations;  ///< mpii_human_pose_v1_u12_1.mat
  std::string keyframes;    ///< mpii_human_pose_v1_sequences_keyframes.mat
  std::vector<std::string> image_folders;
  std::vector<std::string> sequence_folders;
};

/// Finds them; see open_mpii_dataset for where it looks. Throws InputError, saying where it looked,
/// if a .mat file, the root, or a folder that the manifest names is missing.
MpiiPlaces find_mpii_places(const SourceSpec& spec, const std::filesystem::path& base);

/// The keyframes' file in the first of `folders` that has it; empty if none has.
std::string find_mpii_keyframes(const std::vector<std::string>& folders,
                                const std::filesystem::path& base);

}  // namespace eventgan
