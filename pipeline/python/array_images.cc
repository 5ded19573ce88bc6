#include "pipeline/python/detail/array_images.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include "manifests/values/faults.h"

namespace eventgan {

/// "(260, 861, 3)".
std::string shape_text(const py::array& array) {
  std::string text = "(";
  for (py::ssize_t axis = 0; axis < array.ndim(); ++axis) {
    text += (axis > 0 ? ", " : "") + std::to_string(array.shape(axis));
  }
  return text + ")";
}

namespace {

/// A number of an image, 0..255; nothing if it is not in 0..1 or not a number.
template <class T>
std::optional<std::uint8_t> level_of(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof(value));  // may lie anywhere
  if constexpr (std::is_same_v<T, std::uint8_t>) {
    return value;
  } else {
    if (!(value >= 0 && value <= 1)) return std::nullopt;
    return static_cast<std::uint8_t>(std::lround(value * 255));
  }
}

template <class T>
std::vector<std::uint8_t> packed(const Pixels& pixels, const char* name) {
  std::vector<std::uint8_t> levels(pixels.size.pixel_count() *
                                   static_cast<std::size_t>(pixels.channels));
  auto level = levels.begin();
  for (int y = 0; y < pixels.size.height; ++y) {
    const std::byte* row = pixels.data + y * pixels.strides[0];
    for (int x = 0; x < pixels.size.width; ++x, row += pixels.strides[1]) {
      for (int channel = 0; channel < pixels.channels; ++channel) {
        const std::byte* at = row + channel * pixels.strides[2];
        const auto found = level_of<T>(at);
        if (!found) {
          T value;
          std::memcpy(&value, at, sizeof(value));
          throw UsageError("expected floating-point numbers from 0 to 1, got " +
                           std::to_string(static_cast<double>(value)) + " at row " +
                           std::to_string(y) + ", column " + std::to_string(x) + " of " + name);
        }
        *level++ = *found;
      }
    }
  }
  return levels;
}

}  // namespace

PreparedFrame prepared(const Pixels& pixels, const ImageSpec& spec, const char* name) {
  const auto channels =
      pixels.channels == 1 ? ImageView::Channels::kGrey : ImageView::Channels::kRgb;
  std::vector<std::uint8_t> copy;
  const auto* levels = reinterpret_cast<const std::uint8_t*>(pixels.data);
  if (!pixels.is_packed_uint8()) {
    switch (pixels.type) {
      case Pixels::Type::kUint8:
        copy = packed<std::uint8_t>(pixels, name);
        break;
      case Pixels::Type::kFloat32:
        copy = packed<float>(pixels, name);
        break;
      case Pixels::Type::kFloat64:
        copy = packed<double>(pixels, name);
        break;
    }
    levels = copy.data();
  }
  try {
    return prepare_frame({pixels.size, levels, channels}, spec);
  } catch (const std::runtime_error& error) {
    throw UsageError(std::string(error.what()) + ", in " + name);
  }
}

Images::Images(py::array given, const char* name, bool is_batch)
    : array_(std::move(given)), name_(name) {
  const py::ssize_t first = is_batch ? 1 : 0;
  const py::ssize_t axes = array_.ndim() - first;
  if ((axes != 2 && axes != 3) || (axes == 3 && array_.shape(first + 2) != 3)) {
    throw UsageError(std::string("expected an array ") +
                     (is_batch ? "[N, H, W] or [N, H, W, 3]" : "[H, W] or [H, W, 3]") +
                     ", got one of shape " + shape_text(array_) + " for " + name);
  }
  const py::ssize_t height = array_.shape(first);
  const py::ssize_t width = array_.shape(first + 1);
  constexpr auto kMost = static_cast<py::ssize_t>(kMaxImagePixels);
  if (height < 1 || width < 1 || height > kMost || width > kMost || height * width > kMost) {
    throw UsageError("expected images of 1 to " + std::to_string(kMaxImagePixels) +
                     " pixels, got shape " + shape_text(array_) + " for " + name);
  }
  const py::dtype type = array_.dtype();
  if (type.kind() != 'f' && !(type.kind() == 'u' && type.itemsize() == 1)) {
    throw UsageError("expected uint8, or floating-point numbers from 0 to 1, got " +
                     py::str(py::handle(type)).cast<std::string>() + " for " + name);
  }
  const bool is_float32 = type.is(py::dtype::of<float>());
  if (type.kind() == 'f' && !is_float32 && !type.is(py::dtype::of<double>())) {
    array_ = array_.attr("astype")("float64");
  }
  first_.type = type.kind() == 'u' ? Pixels::Type::kUint8
                : is_float32       ? Pixels::Type::kFloat32
                                   : Pixels::Type::kFloat64;
  first_.data = static_cast<const std::byte*>(array_.data());
  first_.size = {static_cast<int>(height), static_cast<int>(width)};
  first_.channels = axes == 3 ? 3 : 1;
  for (py::ssize_t axis = 0; axis < axes; ++axis) {
    first_.strides[static_cast<std::size_t>(axis)] = array_.strides(first + axis);
  }
  if (is_batch) {
    count_ = static_cast<std::size_t>(array_.shape(0));
    stride_ = array_.strides(0);
  }
}

Pair::Pair(const py::array& first, const py::array& second, bool is_batch)
    : previous(first, "previous", is_batch), following(second, "following", is_batch) {
  if (previous.size() != following.size() || previous.count() != following.count()) {
    throw UsageError("expected images of one size, got shapes " + previous.shape() + " and " +
                     following.shape() + " for previous and following");
  }
}

}  // namespace eventgan
