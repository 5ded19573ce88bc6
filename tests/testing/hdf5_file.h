#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <variant>
#include <vector>

namespace eventgan::testing {

/// Values of one dataset in C order.
struct Hdf5Dataset {
  std::vector<std::uint64_t> shape;
  std::variant<std::vector<double>, std::vector<float>, std::vector<std::int64_t>,
               std::vector<std::string>, std::vector<std::uint8_t>>
      values;
  /// Bytes of each text, padded with zeros; 0: of variable length.
  std::size_t text_width = 0;
};

/// Writes an HDF5 file of these datasets, with the groups that their names ("pose/2d") need. What
/// has an @ in its name ("pose@unit", "@unit") is an attribute of what is before it, or of the
/// file.
void write_hdf5(const std::filesystem::path& path,
                const std::map<std::string, Hdf5Dataset>& datasets);

}  // namespace eventgan::testing
