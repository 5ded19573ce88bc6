#pragma once

#include <filesystem>

#include "stages/frames/mpii/mpii_list_row_internal.h"

namespace eventgan {

/// Reads a JSON list of people, or an HDF5 table of them; which of the two it is, its first bytes
/// tell. Throws InputError if it is neither, is damaged, or a row names no image.
MpiiList read_mpii_list(const std::filesystem::path& file);

}  // namespace eventgan
