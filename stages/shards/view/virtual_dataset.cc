#include "stages/shards/view/virtual_dataset_internal.h"

namespace eventgan {
namespace {

Hdf5Handle space_of(const Dims& dims, const std::string& path) {
  return {H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose, "create",
          path};
}

}  // namespace

Hdf5Handle create_virtual_dataset(hid_t location, const std::string& path,
                                  const std::string& source, hid_t type, const Dims& dims,
                                  const std::vector<MappedRows>& rows, const void* missing) {
  const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
  if (missing != nullptr) checked(H5Pset_fill_value(creation, type, missing), "fill", path);
  const Hdf5Handle space = space_of(dims, path);
  Dims start(dims.size(), 0);
  Dims count = dims;
  for (const MappedRows& range : rows) {
    start[0] = range.first;
    count[0] = range.count;
    checked(
        H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
        "select in", path);
    checked(
        H5Pset_virtual(creation, space, range.file.c_str(), source.c_str(), space_of(count, path)),
        "map", path);
  }
  checked(H5Sselect_all(space), "select in", path);
  return {H5Dcreate2(location, path.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT),
          H5Dclose, "create", path};
}

}  // namespace eventgan
