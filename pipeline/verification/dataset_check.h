#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace eventgan {

/// What is wrong with dataset.json and dataset.h5 of an output folder: that they are not what
/// `finalize` makes of the plan and the markers, or do not go together. Lines "PATH: expected X,
/// got Y"; none if they are sound, or neither is there.
std::vector<std::string> dataset_faults(const std::filesystem::path& folder);

}  // namespace eventgan
