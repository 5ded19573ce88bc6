#include "stages/base/hdf5/hdf5.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <functional>
#include <mutex>
#include <numeric>

namespace eventgan {
namespace {

std::mutex& hdf5_mutex() {
  static std::mutex mutex;
  return mutex;
}

thread_local int locks_held = 0;

/// HDF5 walks from the failed call inwards; the last description is nearest to the cause.
herr_t keep_description(unsigned, const H5E_error2_t* error, void* reason) {
  if (error->desc != nullptr) *static_cast<std::string*>(reason) = error->desc;
  return 0;
}

Hdf5Handle copy_of(hid_t type) { return {H5Tcopy(type), H5Tclose, "copy", "a type"}; }

/// numpy's name of an element's type: "int64", "uint8", "float32"…; else "str" and "bytes".
template <class Element>
std::string type_name() {
  if constexpr (std::is_same_v<Element, std::string>) {
    return "str";
  } else if constexpr (std::is_same_v<Element, std::vector<char>>) {
    return "bytes";
  } else if constexpr (std::is_same_v<Element, Half>) {
    return "float16";
  } else {
    const std::string bits = std::to_string(8 * sizeof(Element));
    if (std::is_floating_point_v<Element>) return "float" + bits;
    return (std::is_signed_v<Element> ? "int" : "uint") + bits;
  }
}

/// What HDF5 takes for an `Element`, and what an element is when HDF5 has filled it.
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
struct InMemory<std::vector<char>> {
  using Type = hvl_t;
  static Type from(const std::vector<char>& value) {
    return {value.size(), const_cast<char*>(value.data())};
  }
  static std::vector<char> to(Type value) {
    const auto* first = static_cast<const char*>(value.p);
    return {first, first + value.len};
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

std::size_t count_of(hid_t space, const std::string& object) {
  return static_cast<std::size_t>(checked(H5Sget_simple_extent_npoints(space), "read", object));
}

/// The part of a dataset's space.
Hdf5Handle block_of(hid_t dataset, const std::string& path, const char* action, const Dims& start,
                    const Dims& count) {
  Hdf5Handle space(H5Dget_space(dataset), H5Sclose, action, path);
  checked(H5Sselect_hyperslab(space, H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
          "select in", path);
  return space;
}

std::string called(const char* name) { return std::string("attribute ") + name; }

void write_attribute(hid_t object, const char* name, hid_t type, hid_t space, const void* data) {
  Hdf5Handle attribute(H5Acreate2(object, name, type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                       "create", called(name));
  if (data != nullptr) checked(H5Awrite(attribute, type, data), "write", called(name));
  attribute.close(called(name));
}

Hdf5Handle scalar() { return {H5Screate(H5S_SCALAR), H5Sclose, "create", "a scalar"}; }

}  // namespace

Hdf5Lock::Hdf5Lock() {
  if (locks_held++ == 0) hdf5_mutex().lock();
  // Whoever opens a file closes it. What HDF5 does at the end of the process crashes on a file
  // whose close() has failed.
  static const herr_t no_end = H5dont_atexit();
  static_cast<void>(no_end);
  thread_local const herr_t quiet = H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  static_cast<void>(quiet);
}

Hdf5Lock::~Hdf5Lock() {
  if (--locks_held == 0) hdf5_mutex().unlock();
}

bool Hdf5Lock::is_held() { return locks_held > 0; }

std::string hdf5_version() {
  const Hdf5Lock lock;
  unsigned major = 0, minor = 0, release = 0;
  checked(H5get_libversion(&major, &minor, &release), "read", "the version");
  return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(release);
}

void require_hdf5_lock() { assert(Hdf5Lock::is_held()); }

void throw_hdf5_error(const char* action, const std::string& object) {
  std::string reason = "unknown reason";
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_DOWNWARD, keep_description, &reason);
  // The file drivers wrap the system's message in addresses and times: "..., error message = 'No
  // space left on device', ...".
  const std::string before = "error message = '";
  if (const std::size_t begin = reason.find(before); begin != std::string::npos) {
    reason.erase(0, begin + before.size());
    reason.erase(std::min(reason.find('\''), reason.size()));
  }
  throw Hdf5Error("cannot " + std::string(action) + " " + object + ": " + reason);
}

Hdf5Handle open_hdf5_file(const std::filesystem::path& path) {
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose, "create", "access properties");
  checked(H5Pset_file_locking(access, false, true), "set", "file locking");
  return {H5Fopen(path.c_str(), H5F_ACC_RDONLY, access), H5Fclose, "open", "the file"};
}

Hdf5Handle open_object(hid_t location, const std::string& path) {
  return {H5Oopen(location, path.c_str(), H5P_DEFAULT), H5Oclose, "open", path};
}

bool has_object(hid_t file, const std::string& path) {
  require_hdf5_lock();
  return H5Lexists(file, path.c_str(), H5P_DEFAULT) > 0 &&
         H5Oexists_by_name(file, path.c_str(), H5P_DEFAULT) > 0;
}

Hdf5Handle create_group(hid_t location, const std::string& path) {
  const Hdf5Handle creation = creation_properties(H5P_GROUP_CREATE);
  return {H5Gcreate2(location, path.c_str(), H5P_DEFAULT, creation, H5P_DEFAULT), H5Gclose,
          "create", path};
}

Hdf5Handle creation_properties(hid_t object_class) {
  Hdf5Handle creation(H5Pcreate(object_class), H5Pclose, "create", "creation properties");
  checked(H5Pset_obj_track_times(creation, false), "set", "creation properties");
  return creation;
}

Hdf5Handle text_type() {
  Hdf5Handle type = copy_of(H5T_C_S1);
  checked(H5Tset_size(type, H5T_VARIABLE), "make", "a text type");
  checked(H5Tset_cset(type, H5T_CSET_UTF8), "make", "a text type");
  return type;
}

Hdf5Handle bytes_type() { return {H5Tvlen_create(H5T_STD_U8LE), H5Tclose, "make", "a bytes type"}; }

namespace {

/// IEEE 754 binary16, which HDF5 1.10 has no name for.
Hdf5Handle half_type() {
  Hdf5Handle type = copy_of(H5T_IEEE_F32LE);
  checked(H5Tset_fields(type, 15, 10, 5, 0, 10), "make", "float16");
  checked(H5Tset_size(type, 2), "make", "float16");
  checked(H5Tset_ebias(type, 15), "make", "float16");
  return type;
}

}  // namespace

Hdf5Handle number_type(std::size_t size, bool is_float, bool is_signed) {
  if (is_float && size == 2) return half_type();
  if (is_float) return copy_of(size == 4 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE);
  switch (size) {
    case 1:
      return copy_of(is_signed ? H5T_STD_I8LE : H5T_STD_U8LE);
    case 2:
      return copy_of(is_signed ? H5T_STD_I16LE : H5T_STD_U16LE);
    case 4:
      return copy_of(is_signed ? H5T_STD_I32LE : H5T_STD_U32LE);
    case 8:
      return copy_of(is_signed ? H5T_STD_I64LE : H5T_STD_U64LE);
    default:
      throw std::logic_error("no column has integers of " + std::to_string(size) + " bytes");
  }
}

std::string shape_text(const Dims& dims) { return fmt::format("[{}]", fmt::join(dims, ", ")); }

std::size_t element_count(const Dims& dims) {
  return std::accumulate(dims.begin(), dims.end(), std::size_t{1}, std::multiplies<>());
}

Dims dims_of(hid_t dataset, const std::string& path) {
  const Hdf5Handle space(H5Dget_space(dataset), H5Sclose, "read", path);
  Dims dims(static_cast<std::size_t>(
      checked(H5Sget_simple_extent_ndims(space), "read the shape of", path)));
  checked(H5Sget_simple_extent_dims(space, dims.data(), nullptr), "read the shape of", path);
  return dims;
}

Hdf5Handle space_of(const Dims& dims, const std::string& path, const Dims& limits) {
  return {H5Screate_simple(static_cast<int>(dims.size()), dims.data(),
                           limits.empty() ? nullptr : limits.data()),
          H5Sclose, "create", path};
}

void set_chunks(hid_t creation, const Dims& chunk, const std::string& path) {
  checked(H5Pset_chunk(creation, static_cast<int>(chunk.size()), chunk.data()), "chunk", path);
}

void set_filters(hid_t creation, int deflate_level, const std::string& path) {
  checked(H5Pset_shuffle(creation), "filter", path);
  if (deflate_level > 0) {
    checked(H5Pset_deflate(creation, static_cast<unsigned>(deflate_level)), "filter", path);
  }
  checked(H5Pset_fletcher32(creation), "filter", path);
}

Hdf5Handle create_dataset(hid_t location, const std::string& path, hid_t type, hid_t space,
                          hid_t creation) {
  return {H5Dcreate2(location, path.c_str(), type, space, H5P_DEFAULT, creation, H5P_DEFAULT),
          H5Dclose, "create", path};
}

template <class Element>
void write_elements(hid_t dataset, const std::string& path, const std::vector<Element>& values) {
  std::vector<typename InMemory<Element>::Type> stored;
  stored.reserve(values.size());
  for (const Element& value : values) stored.push_back(InMemory<Element>::from(value));
  checked(H5Dwrite(dataset, element_type<Element>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, stored.data()),
          "write", path);
}

template <class Element>
std::vector<Element> read_elements(hid_t dataset, const std::string& path, hid_t type) {
  using Stored = typename InMemory<Element>::Type;
  const Hdf5Handle space(H5Dget_space(dataset), H5Sclose, "read", path);
  std::vector<Stored> stored(count_of(space, path));
  std::vector<Element> values;
  if (stored.empty()) return values;
  checked(H5Dread(dataset, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, stored.data()), "read", path);
  if constexpr (is_number<Element>) return stored;
  const Reclaim<Stored> reclaim{type, space, stored};
  values.reserve(stored.size());
  for (const Stored& value : stored) values.push_back(InMemory<Element>::to(value));
  return values;
}

template <class Element>
void write_dataset(hid_t file, const std::string& path, const std::vector<Element>& values,
                   const Dims& dims, int deflate_level, hsize_t rows_per_chunk) {
  if (element_count(dims) != values.size()) throw std::logic_error("values do not fill " + path);
  const Hdf5Handle creation = creation_properties(H5P_DATASET_CREATE);
  if (!values.empty()) {
    Dims chunk = dims;
    chunk[0] = std::min(chunk[0], rows_per_chunk);
    set_chunks(creation, chunk, path);
    // Of text the filters would only see HDF5's references to it.
    if (is_number<Element>) set_filters(creation, deflate_level, path);
  }
  Hdf5Handle dataset =
      create_dataset(file, path, element_type<Element>(), space_of(dims, path), creation);
  if (!values.empty()) write_elements(dataset, path, values);
  dataset.close(path);
}

template <class Element>
std::vector<Element> read_dataset(hid_t file, const std::string& path, Dims& dims) {
  const Hdf5Handle dataset(H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose, "open", path);
  const Hdf5Handle stored_type(H5Dget_type(dataset), H5Tclose, "read", path);
  const Hdf5Handle type = element_type<Element>();
  if (checked(H5Tequal(stored_type, type), "compare the type of", path) == 0) {
    throw Hdf5Error("expected type " + type_name<Element>() + " of " + path + ", got another");
  }
  dims = dims_of(dataset, path);
  return read_elements<Element>(dataset, path, type);
}

#define EVENTGAN_INSTANTIATE(Element)                                                              \
  template void write_elements(hid_t, const std::string&, const std::vector<Element>&);            \
  template std::vector<Element> read_elements<Element>(hid_t, const std::string&, hid_t);          \
  template void write_dataset(hid_t, const std::string&, const std::vector<Element>&, const Dims&, \
                              int, hsize_t);                                                       \
  template std::vector<Element> read_dataset<Element>(hid_t, const std::string&, Dims&)

EVENTGAN_INSTANTIATE(std::int8_t);
EVENTGAN_INSTANTIATE(std::uint8_t);
EVENTGAN_INSTANTIATE(std::int32_t);
EVENTGAN_INSTANTIATE(std::uint32_t);
EVENTGAN_INSTANTIATE(std::int64_t);
EVENTGAN_INSTANTIATE(Half);
EVENTGAN_INSTANTIATE(float);
EVENTGAN_INSTANTIATE(double);
EVENTGAN_INSTANTIATE(std::string);
EVENTGAN_INSTANTIATE(std::vector<char>);

void read_block(hid_t dataset, const std::string& path, const Dims& start, const Dims& count,
                hid_t type, void* values) {
  const Hdf5Handle from = block_of(dataset, path, "read", start, count);
  checked(H5Dread(dataset, type, space_of(count, path), from, H5P_DEFAULT, values), "read", path);
}

void write_block(hid_t dataset, const std::string& path, const Dims& start, const Dims& count,
                 hid_t type, const void* values) {
  const Hdf5Handle to = block_of(dataset, path, "write", start, count);
  checked(H5Dwrite(dataset, type, space_of(count, path), to, H5P_DEFAULT, values), "write", path);
}

std::optional<hsize_t> side_beyond(const Dims& dims, hsize_t limit) {
  if (std::ranges::count(dims, hsize_t{0}) > 0) return std::nullopt;
  hsize_t count = 1;
  for (const hsize_t side : dims) {
    if (side > limit / count) return side;
    count *= side;
  }
  return std::nullopt;
}

void write_attribute(hid_t object, const char* name, const std::string& text) {
  const char* data = text.c_str();
  write_attribute(object, name, text_type(), scalar(), &data);
}

void write_attribute(hid_t object, const char* name, const std::vector<std::string>& texts) {
  std::vector<const char*> data;
  for (const std::string& text : texts) data.push_back(text.c_str());
  write_attribute(object, name, text_type(), space_of({data.size()}, called(name)),
                  data.empty() ? nullptr : data.data());
}

void write_attribute(hid_t object, const char* name, std::int32_t number) {
  write_attribute(object, name, H5T_STD_I32LE, scalar(), &number);
}

std::string read_text_attribute(hid_t object, const char* name) {
  const std::vector<std::string> texts = read_texts_attribute(object, name);
  if (texts.size() != 1) throw Hdf5Error("expected one text in " + called(name));
  return texts[0];
}

std::vector<std::string> read_texts_attribute(hid_t object, const char* name) {
  const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, "open", called(name));
  const Hdf5Handle type = text_type();
  const Hdf5Handle stored_type(H5Aget_type(attribute), H5Tclose, "read", called(name));
  if (checked(H5Tequal(stored_type, type), "compare the type of", called(name)) == 0) {
    throw Hdf5Error("expected text in " + called(name) + ", got another type");
  }
  const Hdf5Handle space(H5Aget_space(attribute), H5Sclose, "read", called(name));
  std::vector<const char*> stored(count_of(space, called(name)));
  std::vector<std::string> texts;
  if (stored.empty()) return texts;
  checked(H5Aread(attribute, type, stored.data()), "read", called(name));
  const Reclaim<const char*> reclaim{type, space, stored};
  for (const char* text : stored) texts.push_back(InMemory<std::string>::to(text));
  return texts;
}

std::int32_t read_number_attribute(hid_t object, const char* name) {
  const Hdf5Handle attribute(H5Aopen(object, name, H5P_DEFAULT), H5Aclose, "open", called(name));
  const Hdf5Handle space(H5Aget_space(attribute), H5Sclose, "read", called(name));
  if (count_of(space, called(name)) != 1) {
    throw Hdf5Error("expected one number in " + called(name));
  }
  std::int32_t number = 0;
  checked(H5Aread(attribute, H5T_NATIVE_INT32, &number), "read", called(name));
  return number;
}

}  // namespace eventgan
