#include <utf8.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "stages/archives/numpy_elements_internal.h"

namespace eventgan {
namespace {

static_assert(std::endian::native == std::endian::little, "numpy's '<' is copied as it is");

constexpr std::size_t kMostDimensions = 32;  // numpy's own limit

std::optional<std::size_t> product(std::size_t a, std::size_t b) {
  if (a != 0 && b > std::numeric_limits<std::size_t>::max() / a) return std::nullopt;
  return a * b;
}

// Element k of the result is element order[k] of the data: the identity, or the way from Fortran's
// order (first index fastest) into C's.
std::vector<std::size_t> c_order(const std::vector<std::size_t>& shape, std::size_t count) {
  std::vector<std::size_t> strides(shape.size(), 1);
  for (std::size_t d = 1; d < shape.size(); ++d) strides[d] = strides[d - 1] * shape[d - 1];
  std::vector<std::size_t> index(shape.size(), 0);
  std::vector<std::size_t> order(count);
  std::size_t offset = 0;
  for (std::size_t k = 0; k < count; ++k) {
    order[k] = offset;
    for (std::size_t d = shape.size(); d-- > 0;) {
      offset += strides[d];
      if (++index[d] < shape[d]) break;
      offset -= strides[d] * shape[d];
      index[d] = 0;
    }
  }
  return order;
}

template <class T>
std::vector<T> copy_numbers(std::span<const std::byte> data) {
  std::vector<T> values(data.size() / sizeof(T));
  if (!data.empty()) std::memcpy(values.data(), data.data(), data.size());
  return values;
}

std::string utf32_text(std::span<const std::byte> element, const std::string& name) {
  std::string text;
  std::size_t end = element.size();
  while (end >= 4 && element[end - 1] == std::byte{0} && element[end - 2] == std::byte{0} &&
         element[end - 3] == std::byte{0} && element[end - 4] == std::byte{0}) {
    end -= 4;  // padding
  }
  for (std::size_t i = 0; i < end; i += 4) {
    std::uint32_t code = 0;
    std::memcpy(&code, element.data() + i, sizeof(code));
    try {
      utf8::append(char32_t{code}, text);
    } catch (const utf8::invalid_code_point&) {
      refuse_numpy("Unicode text", "code point " + std::to_string(code), name);
    }
  }
  return text;
}

std::string byte_text(std::span<const std::byte> element, const std::string& name) {
  std::string text(reinterpret_cast<const char*>(element.data()), element.size());
  text.resize(text.find_last_not_of('\0') + 1);
  if (!utf8::is_valid(text)) refuse_numpy("ASCII or UTF-8 text", "other bytes", name);
  return text;
}

std::vector<std::string> copy_text(std::span<const std::byte> data, std::size_t item_size,
                                   bool unicode, const std::string& name) {
  std::vector<std::string> values;
  if (item_size == 0) return values;
  values.reserve(data.size() / item_size);
  for (std::size_t at = 0; at < data.size(); at += item_size) {
    const auto element = data.subspan(at, item_size);
    values.push_back(unicode ? utf32_text(element, name) : byte_text(element, name));
  }
  return values;
}

// Size of one element in bytes; none if the dtype is not one of ours.
std::optional<std::size_t> item_size_of(std::string_view descr) {
  if (descr == "|u1" || descr == "|b1") return 1;
  if (descr == "<f4" || descr == "<i4") return 4;
  if (descr == "<f8" || descr == "<i8") return 8;
  const bool unicode = descr.starts_with("<U");
  if (!unicode && !descr.starts_with("|S")) return std::nullopt;
  std::uint32_t length = 0;
  const char* end = descr.data() + descr.size();
  const auto [stop, error] = std::from_chars(descr.data() + 2, end, length);
  if (error != std::errc() || stop != end) return std::nullopt;
  return std::size_t{length} * (unicode ? 4 : 1);
}

}  // namespace

void refuse_numpy(const std::string& expected, std::string got, const std::string& name) {
  std::ranges::replace_if(
      got, [](char c) { return c < ' ' || c > '~'; }, '?');
  throw std::runtime_error("expected " + expected + ", got " + got + ", in " + name);
}

TypedArray decode_numpy_elements(const NumpyLayout& layout, std::span<const std::byte> data,
                                 const std::string& name) {
  const std::string& descr = layout.descr;
  if (descr.find('O') != std::string::npos) {
    refuse_numpy("an array of numbers or text", "Python objects (dtype '" + descr + "')", name);
  }
  const auto item_size = item_size_of(descr);
  if (!item_size) {
    refuse_numpy("dtype <f4, <f8, <i4, <i8, |u1, |b1, <U or |S", "'" + descr + "'", name);
  }
  TypedArray array{.shape = layout.shape, .values = {}};
  if (array.shape.size() > kMostDimensions) {
    refuse_numpy("at most 32 dimensions", std::to_string(array.shape.size()), name);
  }
  std::optional<std::size_t> size_bytes = item_size;
  for (const std::size_t size : array.shape) {
    if (size_bytes) size_bytes = product(*size_bytes, size);
  }
  if (size_bytes != data.size()) {
    refuse_numpy((size_bytes ? std::to_string(*size_bytes) : "countless") + " bytes for shape " +
                     array.shape_text() + " of " + descr,
                 std::to_string(data.size()), name);
  }
  if (*item_size == 0) {
    // Elements without bytes: their number could not be checked against the input.
    const bool empty = std::ranges::find(array.shape, 0u) != array.shape.end();
    if (!empty) refuse_numpy("text of at least one character", "'" + descr + "'", name);
  }

  if (descr == "<f8") {
    array.values = copy_numbers<double>(data);
  } else if (descr == "<f4") {
    array.values = copy_numbers<float>(data);
  } else if (descr == "<i8") {
    array.values = copy_numbers<std::int64_t>(data);
  } else if (descr == "<i4") {
    array.values = copy_numbers<std::int32_t>(data);
  } else if (descr == "|u1") {
    array.values = copy_numbers<std::uint8_t>(data);
  } else if (descr == "|b1") {
    std::vector<bool> values(data.size());
    for (std::size_t i = 0; i < data.size(); ++i) values[i] = data[i] != std::byte{0};
    array.values = std::move(values);
  } else {
    array.values = copy_text(data, *item_size, descr[1] == 'U', name);
  }

  if (layout.fortran_order && array.shape.size() > 1) {
    const auto order = c_order(array.shape, array.size());
    std::visit(
        [&](auto& elements) {
          auto sorted = elements;
          for (std::size_t k = 0; k < order.size(); ++k) sorted[k] = elements[order[k]];
          elements = std::move(sorted);
        },
        array.values);
  }
  return array;
}

}  // namespace eventgan
