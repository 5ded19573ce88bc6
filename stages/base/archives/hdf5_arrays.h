#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "stages/base/archives/typed_array.h"

namespace eventgan {

/// The datasets of an HDF5 file, by path without the leading slash ("pose/2d").
struct Hdf5Arrays {
  std::map<std::string, TypedArray> arrays;
  std::map<std::string, std::string> unread;  ///< what is neither numbers nor text, and why
};

/// Reads a whole HDF5 file into memory. Floats of up to 32 bits stay float, others become double;
/// integers become std::int32_t or std::int64_t, enumerations their numbers; text is of fixed or
/// variable length. A dataset that claims more values than its stored bytes can hold is refused
/// before anything is allocated. Links into other files are not followed.
///
/// Throws std::runtime_error naming the file and the dataset. Thread safe.
Hdf5Arrays read_hdf5_arrays(const std::filesystem::path& file);

}  // namespace eventgan
