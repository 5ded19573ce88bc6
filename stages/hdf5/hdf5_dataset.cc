#include <algorithm>
#include <cstdint>
#include <functional>
#include <numeric>
#include <type_traits>

#include "stages/hdf5/hdf5_dataset_internal.h"
#include "stages/hdf5/hdf5_types_internal.h"

namespace eventgan {
namespace {

constexpr hsize_t kRowsPerChunk = 4096;

hsize_t count_of(const Dims& dims) {
  return std::accumulate(dims.begin(), dims.end(), hsize_t{1}, std::multiplies<>());
}

/// What HDF5 takes for a column of `Element`, and what a column is when HDF5 has filled it.
template <class Element>
struct InMemory {
  using Type = Element;
  static Type from(Element value) { return value; }
  static Element to(Type value) { return value; }
};
template <>
struct InMemory<std::string> {
  using Type = const char*;
  static Type from(const std::string& value) { return value.c_str(); }
  static std::string to(Type value) { return value == nullptr ? "" : value; }
};
template <>
struct InMemory<Bytes> {
  using Type = hvl_t;
  static Type from(const Bytes& value) {
    return {value.value.size(), const_cast<char*>(value.value.data())};
  }
  static Bytes to(Type value) {
    return {value.len == 0 ? "" : std::string(static_cast<const char*>(value.p), value.len)};
  }
};

/// Gives back the memory that HDF5 took for elements of variable length.
template <class Stored>
struct Reclaim {
  hid_t type;
  hid_t space;
  std::vector<Stored>& values;
  ~Reclaim() { H5Dvlen_reclaim(type, space, H5P_DEFAULT, values.data()); }
};

}  // namespace

Hdf5Handle creation_properties(hid_t object_class) {
  Hdf5Handle creation(H5Pcreate(object_class), H5Pclose, "create", "creation properties");
  checked(H5Pset_obj_track_times(creation, false), "set", "creation properties");
  return creation;
}

void set_filters(hid_t creation, int deflate_level, const std::string& path) {
  checked(H5Pset_shuffle(creation), "filter", path);
  if (deflate_level > 0) {
    checked(H5Pset_deflate(creation, static_cast<unsigned>(deflate_level)), "filter", path);
  }
  checked(H5Pset_fletcher32(creation), "filter", path);
}

Dims dims_of(hid_t dataset, const std::string& path) {
  const Hdf5Handle space(H5Dget_space(dataset), H5Sclose, "read", path);
  Dims dims(static_cast<std::size_t>(
      checked(H5Sget_simple_extent_ndims(space), "read the shape of", path)));
  checked(H5Sget_simple_extent_dims(space, dims.data(), nullptr), "read the shape of", path);
  return dims;
}

template <class Element>
void write_dataset(hid_t file, const std::string& path, const std::vector<Element>& values,
                   const Dims& dims, int deflate_level) {
  if (count_of(dims) != values.size()) throw std::logic_error("values do not fill " + path);
  const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
  if (!values.empty()) {
    Dims chunk = dims;
    chunk[0] = std::min(chunk[0], kRowsPerChunk);
    checked(H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data()), "chunk", path);
    // Of text the filters would only see HDF5's references to it.
    if (std::is_arithmetic_v<Element>) set_filters(creation, deflate_level, path);
  }
  const Hdf5Handle type = element_type<Element>();
  const Hdf5Handle space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr),
                         H5Sclose, "create", path);
  Hdf5Handle dataset(
      H5Dcreate2(file, path.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT), H5Dclose,
      "create", path);
  if (!values.empty()) {
    std::vector<typename InMemory<Element>::Type> stored;
    stored.reserve(values.size());
    for (const Element& value : values) stored.push_back(InMemory<Element>::from(value));
    checked(H5Dwrite(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, stored.data()), "write", path);
  }
  dataset.close(path);
}

template <class Element>
std::vector<Element> read_dataset(hid_t file, const std::string& path, Dims& dims) {
  using Stored = typename InMemory<Element>::Type;
  const Hdf5Handle dataset(H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose, "open", path);
  const Hdf5Handle space(H5Dget_space(dataset), H5Sclose, "read", path);
  const Hdf5Handle stored_type(H5Dget_type(dataset), H5Tclose, "read", path);
  const Hdf5Handle type = element_type<Element>();
  if (checked(H5Tequal(stored_type, type), "compare the type of", path) == 0) {
    throw Hdf5Error("expected type " + type_name<Element>() + " of " + path + ", got another");
  }
  dims = dims_of(dataset, path);
  std::vector<Stored> stored(count_of(dims));
  std::vector<Element> values;
  if (stored.empty()) return values;
  checked(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, stored.data()), "read", path);
  if constexpr (std::is_arithmetic_v<Element>) return stored;
  const Reclaim<Stored> reclaim{type, space, stored};
  values.reserve(stored.size());
  for (const Stored& value : stored) values.push_back(InMemory<Element>::to(value));
  return values;
}

#define EVENTGAN_INSTANTIATE(Element)                                                              \
  template void write_dataset(hid_t, const std::string&, const std::vector<Element>&, const Dims&, \
                              int);                                                                \
  template std::vector<Element> read_dataset<Element>(hid_t, const std::string&, Dims&)

EVENTGAN_INSTANTIATE(std::int8_t);
EVENTGAN_INSTANTIATE(std::uint8_t);
EVENTGAN_INSTANTIATE(std::int32_t);
EVENTGAN_INSTANTIATE(std::uint32_t);
EVENTGAN_INSTANTIATE(std::int64_t);
EVENTGAN_INSTANTIATE(float);
EVENTGAN_INSTANTIATE(double);
EVENTGAN_INSTANTIATE(std::string);
EVENTGAN_INSTANTIATE(Bytes);

}  // namespace eventgan
