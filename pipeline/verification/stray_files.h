#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "manifests/plan_outline.h"

namespace eventgan {

/// A line "PATH: expected X, got Y" for each .h5 or .json file of an output folder (not below it)
/// that is neither of the plan nor one the program keeps beside it: a reader that takes all of them
/// would take it for a part of the dataset. A job manifest is none. Sorted.
std::vector<std::string> stray_files(const std::filesystem::path& folder, const PlanOutline& plan);

}  // namespace eventgan
