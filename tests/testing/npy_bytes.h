#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace eventgan::testing {

/// A .npy file: magic, version, padded header with the given dictionary text, data.
std::string npy_file(std::string_view header, std::string_view data, int version = 1);

/// A C-order array of little-endian doubles.
std::string npy_doubles(const std::vector<std::size_t>& shape, const std::vector<double>& values);

/// A list of ASCII strings as numpy stores them ("<U").
std::string npy_strings(const std::vector<std::string>& values);

}  // namespace eventgan::testing
