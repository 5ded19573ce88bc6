#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stages/hdf5/hdf5_handle_internal.h"

namespace eventgan {

/// A new HDF5 file of plain arrays, without the times of writing that would make each file
/// different. Methods throw std::runtime_error naming the path. Names may contain groups
/// ("pose/2d"), made as needed.
class Hdf5Tables {
 public:
  explicit Hdf5Tables(std::filesystem::path path);

  void write(const std::string& name, const std::vector<hsize_t>& shape,
             const std::vector<double>& values);
  void write(const std::string& name, const std::vector<hsize_t>& shape,
             const std::vector<std::int64_t>& values);

  /// Must be called last; without it the file may not be whole.
  void close();

 private:
  void write(const std::string& name, const std::vector<hsize_t>& shape, hid_t stored, hid_t held,
             const void* values);
  void require(bool succeeded) const;

  std::filesystem::path path_;
  Hdf5Handle parents_;   ///< link creation: make groups on the way
  Hdf5Handle timeless_;  ///< dataset creation: no time of writing
  Hdf5Handle file_;
};

}  // namespace eventgan
