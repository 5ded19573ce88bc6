#pragma once

#include <pybind11/numpy.h>

#include <array>
#include <cstddef>
#include <string>

#include "manifests/values/job.h"
#include "stages/frames/decoding/prepared_frame.h"

namespace eventgan {

namespace py = pybind11;

/// "(260, 861, 3)".
std::string shape_text(const py::array& array);

/// An image in the memory of an array, whose owner must be held meanwhile; readable without
/// Python's lock.
struct Pixels {
  enum class Type { kUint8, kFloat32, kFloat64 };

  const std::byte* data = nullptr;
  Type type = Type::kUint8;
  ImageSize size;
  int channels = 1;                      ///< 1 or 3, red, green, blue
  std::array<py::ssize_t, 3> strides{};  ///< bytes from row to row, column to column, channel

  bool is_packed_uint8() const {
    return type == Type::kUint8 && (channels == 1 || strides[2] == 1) && strides[1] == channels &&
           strides[0] == py::ssize_t{channels} * size.width;
  }
};

/// What prepare_frame makes of it; floating-point numbers are rounded to levels. Throws UsageError
/// if a number is not in 0..1, or the image cannot be placed. Without Python's lock.
PreparedFrame prepared(const Pixels& pixels, const ImageSpec& spec, const char* name);

/// Images in an array: [H, W] and [H, W, 3], or a batch of N, [N, H, W] and [N, H, W, 3].
class Images {
 public:
  /// `name`: what messages call it; must outlive this. Converts types that Pixels does not know.
  /// Throws UsageError if it is none.
  Images(py::array given, const char* name, bool is_batch);

  std::size_t count() const { return count_; }
  ImageSize size() const { return first_.size; }
  const char* name() const { return name_; }
  std::string shape() const { return shape_text(array_); }

  Pixels at(std::size_t index) const {
    Pixels pixels = first_;
    pixels.data += static_cast<py::ssize_t>(index) * stride_;
    return pixels;
  }

 private:
  py::array array_;
  const char* name_;
  Pixels first_;
  std::size_t count_ = 1;
  py::ssize_t stride_ = 0;
};

/// Two images of a pair, or as many of each.
struct Pair {
  Images previous;
  Images following;

  /// Throws UsageError unless both are images of one size.
  Pair(const py::array& first, const py::array& second, bool is_batch);
};

}  // namespace eventgan
