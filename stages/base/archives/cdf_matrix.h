#pragma once

#include <filesystem>
#include <string>

#include "stages/base/archives/typed_array.h"

namespace eventgan {

/// Reads the matrix `variable` from a CDF file (NASA's Common Data Format, as the "CDF Internal
/// Format Description" has it), as Human3.6M holds its poses: version 3, a zVariable of one record
/// with two dimensions, of float or double in IEEE's format and either byte order, row or column
/// major, as it is or GZIP'd, alone or with the whole file. Gives [rows, columns] of
/// std::vector<float> or std::vector<double>, bit by bit those of the file.
///
/// A CDF file is a web of records that tell where others lie. Nothing is believed: a record lies
/// within the file, a field within its record, lists end, and what is GZIP'd has its checksum and
/// inflates to exactly the size it is told. Files and what they inflate to are at most 64 MiB each
/// (Human3.6M's longest take is 2.4 MB), so that less than 256 MiB of memory are held.
///
/// Throws std::runtime_error "expected X, got Y, in FILE (VARIABLE)". Thread safe.
TypedArray read_cdf_matrix(const std::filesystem::path& file, const std::string& variable);

}  // namespace eventgan
