#include <stdexcept>
#include <utility>

#include "stages/scenes/layouts/hdf5_tables_internal.h"

namespace eventgan {

Hdf5Tables::Hdf5Tables(std::filesystem::path path)
    : path_(std::move(path)),
      parents_(H5Pcreate(H5P_LINK_CREATE), H5Pclose),
      timeless_(H5Pcreate(H5P_DATASET_CREATE), H5Pclose),
      file_(H5Fcreate(path_.c_str(), H5F_ACC_EXCL, H5P_DEFAULT, H5P_DEFAULT), H5Fclose) {
  require(parents_ >= 0 && timeless_ >= 0 && file_ >= 0);
  // Groups have no times of their own in this file version.
  require(H5Pset_create_intermediate_group(parents_, 1) >= 0);
  require(H5Pset_obj_track_times(timeless_, false) >= 0);
}

void Hdf5Tables::require(bool succeeded) const {
  if (!succeeded) throw std::runtime_error("cannot write " + path_.string());
}

void Hdf5Tables::write(const std::string& name, const std::vector<hsize_t>& shape, hid_t stored,
                       hid_t held, const void* values) {
  const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
  const hid_t dataset =
      H5Dcreate2(file_, name.c_str(), stored, space, parents_, timeless_, H5P_DEFAULT);
  const bool written =
      dataset >= 0 && H5Dwrite(dataset, held, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0;
  const bool closed = dataset >= 0 && H5Dclose(dataset) >= 0;
  H5Sclose(space);
  require(written && closed);
}

void Hdf5Tables::write(const std::string& name, const std::vector<hsize_t>& shape,
                       const std::vector<double>& values) {
  write(name, shape, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data());
}

void Hdf5Tables::write(const std::string& name, const std::vector<hsize_t>& shape,
                       const std::vector<std::int64_t>& values) {
  write(name, shape, H5T_STD_I64LE, H5T_NATIVE_INT64, values.data());
}

void Hdf5Tables::close() {
  try {
    file_.close(path_.string());
  } catch (const Hdf5Error&) {
    require(false);
  }
}

}  // namespace eventgan
