#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include "stages/hdf5/hdf5_internal.h"

namespace eventgan {

/// Rows first .. first + count - 1 of a virtual dataset: all rows of the source in `file`.
struct MappedRows {
  std::string file;
  hsize_t first = 0;
  hsize_t count = 0;  ///< > 0
};

/// What a column of numbers reads as where its shard is not there: NaN, or an integer with all bits
/// set (-1, 255). HDF5 1.10 has no such value for text, which reads as empty.
template <class Number>
Number missing_value() {
  if constexpr (std::is_floating_point_v<Number>) {
    return std::numeric_limits<Number>::quiet_NaN();
  } else {
    return static_cast<Number>(-1);
  }
}

/// Creates the virtual dataset `path` below `location`, which reads as the datasets at `source` in
/// other files. `dims`: its shape, of which all but the rows are those of every source too; it has
/// elements. File names are relative to the folder of the file that holds `location`. `missing`: an
/// element of `type`, see missing_value; none if null. Gives the open dataset. Throws Hdf5Error.
Hdf5Handle create_virtual_dataset(hid_t location, const std::string& path,
                                  const std::string& source, hid_t type, const Dims& dims,
                                  const std::vector<MappedRows>& rows, const void* missing);

}  // namespace eventgan
