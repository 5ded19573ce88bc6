#include "tests/testing/golden_numbers.h"

#include <hdf5.h>

#include <stdexcept>

namespace eventgan::testing {
namespace {

hid_t checked(hid_t id, const std::string& what) {
  if (id < 0) throw std::runtime_error("cannot open " + what);
  return id;
}

herr_t add_name(hid_t, const char* name, const H5L_info_t*, void* names) {
  static_cast<std::vector<std::string>*>(names)->emplace_back(name);
  return 0;
}

}  // namespace

GoldenArray read_array(const std::filesystem::path& file, const std::string& dataset) {
  const hid_t file_id = checked(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), file.string());
  const hid_t id = checked(H5Dopen2(file_id, dataset.c_str(), H5P_DEFAULT), dataset);
  const hid_t space = H5Dget_space(id);
  std::vector<hsize_t> sides(static_cast<std::size_t>(H5Sget_simple_extent_ndims(space)));
  H5Sget_simple_extent_dims(space, sides.data(), nullptr);
  GoldenArray array{
      {sides.begin(), sides.end()},
      std::vector<float>(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)))};
  const herr_t status =
      H5Dread(id, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, array.values.data());
  H5Sclose(space);
  H5Dclose(id);
  H5Fclose(file_id);
  if (status < 0) throw std::runtime_error("cannot read " + dataset);
  return array;
}

std::vector<std::string> member_names(const std::filesystem::path& file, const std::string& group) {
  const hid_t file_id = checked(H5Fopen(file.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), file.string());
  const hid_t id = checked(H5Gopen2(file_id, group.c_str(), H5P_DEFAULT), group);
  std::vector<std::string> names;
  H5Literate(id, H5_INDEX_NAME, H5_ITER_INC, nullptr, add_name, &names);
  H5Gclose(id);
  H5Fclose(file_id);
  return names;
}

}  // namespace eventgan::testing
