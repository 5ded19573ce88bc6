#pragma once

#include <hdf5.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace eventgan {

/// What HDF5 reports, as text "cannot ACTION OBJECT: REASON"; the file's name is added by who knows
/// it.
class Hdf5Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Keeps HDF5 from printing its errors in this thread; they are thrown instead.
void quiet_hdf5_errors();

/// Throws Hdf5Error with the innermost reason on HDF5's error stack.
[[noreturn]] void throw_hdf5_error(const char* action, const std::string& object);

/// `result`, unless it is one of HDF5's negative error codes.
template <class Result>
Result checked(Result result, const char* action, const std::string& object) {
  if (result < 0) throw_hdf5_error(action, object);
  return result;
}

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
    if (id_ >= 0) close_(id_);
  }

  operator hid_t() const { return id_; }  // NOLINT: stands wherever HDF5 takes an identifier

  /// Closes now and throws Hdf5Error if that fails.
  void close(const std::string& object) {
    checked(close_(std::exchange(id_, H5I_INVALID_HID)), "close", object);
  }

 private:
  hid_t id_ = H5I_INVALID_HID;
  Close close_ = nullptr;
};

}  // namespace eventgan
