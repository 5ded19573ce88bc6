#pragma once

#include <filesystem>

#include "stages/frames/mpii/mpii_list_row_internal.h"

namespace eventgan {

/// Reads an HDF5 table of people (valid.h5, train.h5): datasets of equal length side by side, row i
/// of each belonging to person i. Every numeric or text dataset as long as `imgname` becomes a
/// field of the rows, NaN and infinity null; others are named in the notes. `imgname` may be fixed
/// or variable-length text, or an array of character codes padded with zeros. Throws InputError.
/// Thread safe.
MpiiList read_mpii_table(const std::filesystem::path& file);

}  // namespace eventgan
