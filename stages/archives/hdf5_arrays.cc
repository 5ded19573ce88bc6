#include "stages/archives/hdf5_arrays.h"

#include <hdf5.h>
#include <utf8.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "stages/files/text_file.h"
#include "stages/hdf5/hdf5_handle_internal.h"

namespace eventgan {
namespace {

// No deflate stream grows by more than this factor when it is inflated.
constexpr hsize_t kDeflateLimit = 1032;

/// Why a dataset is left out: its kind, not damage.
struct NotAnArray {
  std::string reason;
};

struct OpenDataset {
  hid_t id;
  hid_t type;
  hid_t space;
  std::size_t count;
};

[[noreturn]] void fail_read() { throw std::runtime_error("expected readable values, got damage"); }

template <class T>
std::vector<T> read_numbers(const OpenDataset& dataset, hid_t memory_type) {
  std::vector<T> values(dataset.count);
  if (H5Dread(dataset.id, memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    fail_read();
  }
  return values;
}

std::vector<std::int64_t> read_wide_integers(const OpenDataset& dataset) {
  auto values = read_numbers<std::int64_t>(dataset, H5T_NATIVE_INT64);
  // HDF5 turns what does not fit into the largest value that does.
  if (std::ranges::find(values, std::numeric_limits<std::int64_t>::max()) != values.end()) {
    throw NotAnArray{"integers beyond 63 bits"};
  }
  return values;
}

std::vector<std::string> read_variable_text(const OpenDataset& dataset) {
  std::vector<char*> pointers(dataset.count);
  if (H5Dread(dataset.id, dataset.type, H5S_ALL, H5S_ALL, H5P_DEFAULT, pointers.data()) < 0) {
    fail_read();
  }
  std::vector<std::string> values;
  values.reserve(pointers.size());
  for (const char* text : pointers) values.emplace_back(text != nullptr ? text : "");
  H5Dvlen_reclaim(dataset.type, dataset.space, H5P_DEFAULT, pointers.data());
  return values;
}

std::vector<std::string> read_fixed_text(const OpenDataset& dataset) {
  const std::size_t width = H5Tget_size(dataset.type);
  std::vector<char> bytes(dataset.count * width);
  if (H5Dread(dataset.id, dataset.type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()) < 0) {
    fail_read();
  }
  std::vector<std::string> values;
  values.reserve(dataset.count);
  for (std::size_t i = 0; i < dataset.count; ++i) {
    const char* text = bytes.data() + i * width;
    values.emplace_back(text, strnlen(text, width));
  }
  return values;
}

decltype(TypedArray::values) read_values(const OpenDataset& dataset) {
  const std::size_t width = H5Tget_size(dataset.type);
  switch (H5Tget_class(dataset.type)) {
    case H5T_FLOAT:
      if (width > sizeof(double)) throw NotAnArray{"floats beyond 64 bits"};
      if (width > sizeof(float)) return read_numbers<double>(dataset, H5T_NATIVE_DOUBLE);
      return read_numbers<float>(dataset, H5T_NATIVE_FLOAT);
    case H5T_INTEGER:
    case H5T_ENUM:
      if (width < sizeof(std::int32_t))
        return read_numbers<std::int32_t>(dataset, H5T_NATIVE_INT32);
      return read_wide_integers(dataset);
    case H5T_STRING: {
      auto values = H5Tis_variable_str(dataset.type) > 0 ? read_variable_text(dataset)
                                                         : read_fixed_text(dataset);
      for (const std::string& text : values) {
        if (!utf8::is_valid(text)) throw NotAnArray{"text that is not UTF-8"};
      }
      return values;
    }
    default:
      throw NotAnArray{"neither numbers nor text"};
  }
}

TypedArray read_array(hid_t id) {
  const Hdf5Handle space(H5Dget_space(id), H5Sclose);
  const Hdf5Handle type(H5Dget_type(id), H5Tclose);
  if (space < 0 || type < 0) fail_read();
  if (H5Sget_simple_extent_type(space) == H5S_NULL) throw NotAnArray{"a dataset without values"};
  std::vector<hsize_t> dims(
      static_cast<std::size_t>(std::max(H5Sget_simple_extent_ndims(space), 0)));
  H5Sget_simple_extent_dims(space, dims.data(), nullptr);
  const hsize_t width = std::max<hsize_t>(H5Tget_size(type), 1);
  const hsize_t stored = H5Dget_storage_size(id);
  const hsize_t limit = stored > std::numeric_limits<hsize_t>::max() / kDeflateLimit
                            ? 0
                            : stored * kDeflateLimit / width;
  TypedArray array;
  hsize_t count = 1;
  for (const hsize_t size : dims) count = size == 0 ? 0 : count;
  for (const hsize_t size : dims) {
    array.shape.push_back(size);
    if (count != 0 && size > limit / count) {
      throw std::runtime_error("expected values that " + std::to_string(stored) +
                               " stored bytes can hold, got a dimension of " +
                               std::to_string(size));
    }
    count *= size;
  }
  array.values = read_values({id, type, space, static_cast<std::size_t>(count)});
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
  quiet_hdf5_errors();
  const Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (file < 0) {
    throw std::runtime_error("expected a whole HDF5 file, got one that does not open, in " +
                             path.string());
  }
  std::vector<std::string> names;
  if (H5Lvisit(file, H5_INDEX_NAME, H5_ITER_INC, collect_name, &names) < 0) {
    throw std::runtime_error("expected readable groups, got damage, in " + path.string());
  }
  Hdf5Arrays result;
  for (const std::string& name : names) {
    const Hdf5Handle object(H5Oopen(file, name.c_str(), H5P_DEFAULT), H5Oclose);
    if (object >= 0 && H5Iget_type(object) != H5I_DATASET) continue;
    try {
      if (object < 0) throw NotAnArray{"a link that leads nowhere"};
      result.arrays.emplace(name, read_array(object));
    } catch (const NotAnArray& other) {
      result.unread.emplace(name, other.reason);
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(std::string(error.what()) + ", in " + path.string() + " (dataset " +
                               name + ")");
    }
  }
  return result;
}

}  // namespace eventgan
