#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace eventgan::testing {

/// A dataset of an HDF5 file as float32, C order, with its shape.
struct GoldenArray {
  std::vector<std::size_t> shape;
  std::vector<float> values;
};

/// Throws if the file or the dataset is not there.
GoldenArray read_array(const std::filesystem::path& file, const std::string& dataset);

/// Names of the members of a group.
std::vector<std::string> member_names(const std::filesystem::path& file, const std::string& group);

}  // namespace eventgan::testing
