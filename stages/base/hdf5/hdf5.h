#pragma once

#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "manifests/values/half.h"

namespace eventgan {

// HDF5 with owned identifiers, and errors as exceptions. All of this program's HDF5 goes through
// here.
//
// Threads: libhdf5 need not be built for them (Debian's is not), and then two calls at once are a
// fault, whatever they are about. So there is one lock for the process, Hdf5Lock, and every call of
// HDF5 is made under it. Whoever is public and uses HDF5 takes it for as long as its calls belong
// together, and its callers need not know; handles take it to close. Functions and classes of
// private headers, these here among them, expect their caller to hold it; `checked` asserts that.
// A thread may take it again. What needs no HDF5 (hashing, inflating, checking) is done without it.

/// The right to call HDF5, for a scope. Also keeps HDF5 from printing its errors in this thread;
/// they are thrown instead.
class Hdf5Lock {
 public:
  Hdf5Lock();
  ~Hdf5Lock();
  Hdf5Lock(const Hdf5Lock&) = delete;
  Hdf5Lock& operator=(const Hdf5Lock&) = delete;

  static bool is_held();  ///< by this thread
};

/// Of the library as it is loaded: "1.10.8".
std::string hdf5_version();

// ---- Errors

/// What HDF5 reports, as text "cannot ACTION OBJECT: REASON"; the caller adds the file's name.
class Hdf5Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Asserts that the lock is held.
void require_hdf5_lock();

/// Throws Hdf5Error with the innermost reason on HDF5's error stack.
[[noreturn]] void throw_hdf5_error(const char* action, const std::string& object);

/// `result`, unless it is one of HDF5's negative error codes.
template <class Result>
Result checked(Result result, const char* action, const std::string& object) {
  require_hdf5_lock();
  if (result < 0) throw_hdf5_error(action, object);
  return result;
}

// ---- Objects. All functions from here on throw Hdf5Error.

/// Owns one HDF5 identifier.
class Hdf5Handle {
 public:
  using Close = herr_t (*)(hid_t);

  Hdf5Handle() = default;
  /// Takes what HDF5 gave, also a negative one, which the caller looks at.
  Hdf5Handle(hid_t id, Close closer) : id_(id), close_(closer) {}
  Hdf5Handle(hid_t id, Close closer, const char* action, const std::string& object)
      : id_(checked(id, action, object)), close_(closer) {}
  Hdf5Handle(Hdf5Handle&& other) noexcept
      : id_(std::exchange(other.id_, H5I_INVALID_HID)), close_(other.close_) {}
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept {
    std::swap(id_, other.id_);
    std::swap(close_, other.close_);
    return *this;
  }
  /// Errors at this point are lost: what must be on disk is closed with `close`.
  ~Hdf5Handle() {
    if (id_ < 0) return;
    const Hdf5Lock lock;
    close_(id_);
  }

  operator hid_t() const { return id_; }  // NOLINT: used wherever HDF5 takes an identifier

  /// Closes now and throws Hdf5Error if that fails.
  void close(const std::string& object) {
    checked(close_(std::exchange(id_, H5I_INVALID_HID)), "close", object);
  }

 private:
  hid_t id_ = H5I_INVALID_HID;
  Close close_ = nullptr;
};

/// Opens a file for reading, without locks: what is read here never changes meanwhile, and many
/// cluster file systems have none.
Hdf5Handle open_hdf5_file(const std::filesystem::path& path);

/// Opens a group or a dataset.
Hdf5Handle open_object(hid_t location, const std::string& path);

/// Whether `path` leads to something in `file`.
bool has_object(hid_t file, const std::string& path);

/// Creates a group, open.
Hdf5Handle create_group(hid_t location, const std::string& path);

/// Creation properties without time stamps, for H5P_DATASET_CREATE, H5P_GROUP_CREATE or
/// H5P_FILE_CREATE: a time in the file would make the same samples give other bytes.
Hdf5Handle creation_properties(hid_t object_class);

// ---- Types of elements: numbers, std::string for UTF-8 text, std::vector<char> for sequences of
// bytes

/// Variable-length UTF-8.
Hdf5Handle text_type();

/// Variable-length sequences of uint8.
Hdf5Handle bytes_type();

/// A number as it is in files: little endian, as the machines are that this program runs on, so
/// that it serves for memory too. `size` in bytes.
Hdf5Handle number_type(std::size_t size, bool is_float, bool is_signed);

template <class Element>
inline constexpr bool is_number = std::is_arithmetic_v<Element> || std::is_same_v<Element, Half>;

template <class Element>
Hdf5Handle element_type() {
  if constexpr (std::is_same_v<Element, std::string>) {
    return text_type();
  } else if constexpr (std::is_same_v<Element, std::vector<char>>) {
    return bytes_type();
  } else if constexpr (std::is_same_v<Element, Half>) {
    return number_type(sizeof(Half), true, true);
  } else {
    return number_type(sizeof(Element), std::is_floating_point_v<Element>,
                       std::is_signed_v<Element>);
  }
}

// ---- Datasets

using Dims = std::vector<hsize_t>;

/// "[4, 17, 3]".
std::string shape_text(const Dims& dims);

/// How many elements.
std::size_t element_count(const Dims& dims);

/// Shape of a dataset.
Dims dims_of(hid_t dataset, const std::string& path);

/// A dataspace; `limits`: how far it may grow, not at all if empty.
Hdf5Handle space_of(const Dims& dims, const std::string& path, const Dims& limits = {});

void set_chunks(hid_t creation, const Dims& chunk, const std::string& path);

/// Adds the filters of every numeric dataset: shuffle, deflate unless `deflate_level` is 0,
/// fletcher32.
void set_filters(hid_t creation, int deflate_level, const std::string& path);

/// Creates a dataset, open.
Hdf5Handle create_dataset(hid_t location, const std::string& path, hid_t type, hid_t space,
                          hid_t creation);

/// Writes all elements of an open dataset, in C order.
template <class Element>
void write_elements(hid_t dataset, const std::string& path, const std::vector<Element>& values);

/// Reads all elements of an open dataset, in C order; `type` is that of `Element`, or another that
/// looks the same in memory.
template <class Element>
std::vector<Element> read_elements(hid_t dataset, const std::string& path, hid_t type);

inline constexpr hsize_t kRowsPerChunk = 4096;

/// Creates and writes a whole dataset: C order, chunks of up to so many rows, numbers with filters.
/// A dataset without elements has neither.
template <class Element>
void write_dataset(hid_t file, const std::string& path, const std::vector<Element>& values,
                   const Dims& dims, int deflate_level, hsize_t rows_per_chunk = kRowsPerChunk);

/// Reads a whole dataset; `dims` gets its shape. Throws also if its type is another one.
template <class Element>
std::vector<Element> read_dataset(hid_t file, const std::string& path, Dims& dims);

/// Reads or writes the block of an open dataset that starts at `start` and has the shape `count`:
/// in memory C order, `type`.
void read_block(hid_t dataset, const std::string& path, const Dims& start, const Dims& count,
                hid_t type, void* values);
void write_block(hid_t dataset, const std::string& path, const Dims& start, const Dims& count,
                 hid_t type, const void* values);

/// No deflate stream grows by more than this factor when it is inflated: a dataset that claims more
/// than its stored bytes can give is damaged.
inline constexpr hsize_t kDeflateLimit = 1032;

/// The first side with which `dims` claim more than `limit` elements; none if they do not.
std::optional<hsize_t> side_beyond(const Dims& dims, hsize_t limit);

// ---- Attributes of an open file, group or dataset: UTF-8 text, lists of it, and whole numbers
// (int32)

void write_attribute(hid_t object, const char* name, const std::string& text);
void write_attribute(hid_t object, const char* name, const std::vector<std::string>& texts);
void write_attribute(hid_t object, const char* name, std::int32_t number);

std::string read_text_attribute(hid_t object, const char* name);
std::vector<std::string> read_texts_attribute(hid_t object, const char* name);
std::int32_t read_number_attribute(hid_t object, const char* name);

}  // namespace eventgan
