#include "tests/testing/hdf5_file.h"

#include <hdf5.h>

#include <stdexcept>

namespace eventgan::testing {
namespace {

hid_t need(hid_t id, const std::string& what) {
  if (id < 0) throw std::runtime_error("HDF5 cannot write " + what);
  return id;
}

hid_t new_type(const Hdf5Dataset& dataset) {
  switch (dataset.values.index()) {
    case 0:
      return H5Tcopy(H5T_NATIVE_DOUBLE);
    case 1:
      return H5Tcopy(H5T_NATIVE_FLOAT);
    case 2:
      return H5Tcopy(H5T_NATIVE_INT64);
    case 4:
      return H5Tcopy(H5T_NATIVE_UINT8);
    default: {
      const hid_t type = H5Tcopy(H5T_C_S1);
      H5Tset_size(type, dataset.text_width == 0 ? H5T_VARIABLE : dataset.text_width);
      return type;
    }
  }
}

void write_values(hid_t id, hid_t type, const Hdf5Dataset& dataset) {
  std::vector<const char*> pointers;
  std::string padded;
  const void* data = nullptr;
  if (const auto* texts = std::get_if<std::vector<std::string>>(&dataset.values)) {
    for (const std::string& text : *texts) {
      pointers.push_back(text.c_str());
      padded += text;
      padded.resize(pointers.size() * dataset.text_width, '\0');
    }
    data = dataset.text_width == 0 ? static_cast<const void*>(pointers.data()) : padded.data();
  } else {
    data =
        std::visit([](const auto& values) -> const void* { return values.data(); }, dataset.values);
  }
  const bool is_attribute = H5Iget_type(id) == H5I_ATTR;
  need(is_attribute ? H5Awrite(id, type, data)
                    : H5Dwrite(id, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data),
       "values");
}

}  // namespace

void write_hdf5(const std::filesystem::path& path,
                const std::map<std::string, Hdf5Dataset>& datasets) {
  std::filesystem::create_directories(path.parent_path());
  const hid_t file =
      need(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT), path.string());
  const hid_t with_groups = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(with_groups, 1);
  for (const auto& [name, dataset] : datasets) {
    const std::vector<hsize_t> dims(dataset.shape.begin(), dataset.shape.end());
    const hid_t space = H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr);
    const hid_t type = new_type(dataset);
    hid_t id;
    if (const std::size_t at = name.find('@'); at != name.npos) {
      const std::string owner = "/" + name.substr(0, at);
      id = H5Acreate_by_name(file, owner.c_str(), name.c_str() + at + 1, type, space, H5P_DEFAULT,
                             H5P_DEFAULT, H5P_DEFAULT);
    } else {
      id = H5Dcreate2(file, name.c_str(), type, space, with_groups, H5P_DEFAULT, H5P_DEFAULT);
    }
    write_values(need(id, name), type, dataset);
    H5Idec_ref(id);
    H5Tclose(type);
    H5Sclose(space);
  }
  H5Pclose(with_groups);
  H5Fclose(file);
}

}  // namespace eventgan::testing
