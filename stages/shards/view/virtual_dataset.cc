#include "stages/shards/view/virtual_dataset_internal.h"

namespace eventgan {

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
  return create_dataset(location, path, type, space_of(dims, path), creation);
}

}  // namespace eventgan
