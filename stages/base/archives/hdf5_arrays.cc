#include "stages/base/archives/hdf5_arrays.h"

#include <utf8.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "manifests/files/input_file.h"
#include "stages/base/hdf5/hdf5.h"

namespace eventgan {
namespace {

/// Why a dataset is left out: its kind, not damage.
struct NotAnArray {
  std::string reason;
};

constexpr char kTheValues[] = "the values";  // the caller names the dataset

std::vector<std::int64_t> read_wide_integers(hid_t dataset) {
  auto values = read_elements<std::int64_t>(dataset, kTheValues, element_type<std::int64_t>());
  // HDF5 turns what does not fit into the largest value that does.
  if (std::ranges::find(values, std::numeric_limits<std::int64_t>::max()) != values.end()) {
    throw NotAnArray{"integers beyond 63 bits"};
  }
  return values;
}

std::vector<std::string> read_fixed_text(hid_t dataset, hid_t type, std::size_t count) {
  const std::size_t width = H5Tget_size(type);
  std::vector<char> bytes(count * width);
  checked(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), "read", kTheValues);
  std::vector<std::string> values;
  values.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const char* text = bytes.data() + i * width;
    values.emplace_back(text, strnlen(text, width));
  }
  return values;
}

decltype(TypedArray::values) read_values(hid_t dataset, hid_t type, std::size_t count) {
  const std::size_t width = H5Tget_size(type);
  switch (H5Tget_class(type)) {
    case H5T_FLOAT:
      if (width > sizeof(double)) throw NotAnArray{"floats beyond 64 bits"};
      if (width > sizeof(float)) {
        return read_elements<double>(dataset, kTheValues, element_type<double>());
      }
      return read_elements<float>(dataset, kTheValues, element_type<float>());
    case H5T_INTEGER:
    case H5T_ENUM:
      if (width < sizeof(std::int32_t)) {
        return read_elements<std::int32_t>(dataset, kTheValues, element_type<std::int32_t>());
      }
      return read_wide_integers(dataset);
    case H5T_STRING: {
      auto values = H5Tis_variable_str(type) > 0
                        ? read_elements<std::string>(dataset, kTheValues, type)
                        : read_fixed_text(dataset, type, count);
      for (const std::string& text : values) {
        if (!utf8::is_valid(text)) throw NotAnArray{"text that is not UTF-8"};
      }
      return values;
    }
    default:
      throw NotAnArray{"neither numbers nor text"};
  }
}

TypedArray read_array(hid_t dataset) {
  const Hdf5Handle space(H5Dget_space(dataset), H5Sclose, "read", kTheValues);
  const Hdf5Handle type(H5Dget_type(dataset), H5Tclose, "read", kTheValues);
  if (H5Sget_simple_extent_type(space) == H5S_NULL) throw NotAnArray{"a dataset without values"};
  const Dims dims = dims_of(dataset, kTheValues);
  const hsize_t width = std::max<hsize_t>(H5Tget_size(type), 1);
  const hsize_t stored = H5Dget_storage_size(dataset);
  const hsize_t limit = stored > std::numeric_limits<hsize_t>::max() / kDeflateLimit
                            ? 0
                            : stored * kDeflateLimit / width;
  if (const auto side = side_beyond(dims, limit)) {
    throw std::runtime_error("expected values that " + std::to_string(stored) +
                             " stored bytes can hold, got a dimension of " + std::to_string(*side));
  }
  TypedArray array{{dims.begin(), dims.end()}, {}};
  array.values = read_values(dataset, type, element_count(dims));
  return array;
}

herr_t collect_name(hid_t, const char* name, const H5L_info_t* link, void* names) {
  if (link->type != H5L_TYPE_HARD && link->type != H5L_TYPE_SOFT) return 0;
  static_cast<std::vector<std::string>*>(names)->push_back(name);
  return 0;
}

}  // namespace

Hdf5Arrays read_hdf5_arrays(const std::filesystem::path& path) {
  require_regular_file(path);
  const Hdf5Lock lock;
  Hdf5Handle file;
  try {
    file = open_hdf5_file(path);
  } catch (const Hdf5Error&) {
    throw std::runtime_error("expected a whole HDF5 file, got one that does not open, in " +
                             path.string());
  }
  std::vector<std::string> names;
  if (H5Lvisit(file, H5_INDEX_NAME, H5_ITER_INC, collect_name, &names) < 0) {
    throw std::runtime_error("expected readable groups, got damage, in " + path.string());
  }
  const auto place = [&](const std::string& name) {
    return ", in " + path.string() + " (dataset " + name + ")";
  };
  Hdf5Arrays result;
  for (const std::string& name : names) {
    const Hdf5Handle object(H5Oopen(file, name.c_str(), H5P_DEFAULT), H5Oclose);
    if (object >= 0 && H5Iget_type(object) != H5I_DATASET) continue;
    try {
      if (object < 0) throw NotAnArray{"a link that leads nowhere"};
      result.arrays.emplace(name, read_array(object));
    } catch (const NotAnArray& other) {
      result.unread.emplace(name, other.reason);
    } catch (const Hdf5Error&) {
      throw std::runtime_error("expected readable values, got damage" + place(name));
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(error.what() + place(name));
    }
  }
  return result;
}

}  // namespace eventgan
