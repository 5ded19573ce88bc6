#include "stages/base/archives/mat_json.h"

#include <utf8.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

Json to_json_number(double value) {
  constexpr double kExactIntegers = 9007199254740992;  // 2^53
  if (!std::isfinite(value)) return nullptr;
  if (std::trunc(value) == value && std::abs(value) < kExactIntegers) {
    return static_cast<std::int64_t>(value);
  }
  return value;
}

/// The number's own type, from bytes of either order.
template <class T>
T stored_at(const MatArray& value, std::size_t index) {
  std::array<char, sizeof(T)> bytes;
  std::memcpy(bytes.data(), value.data.data() + index * sizeof(T), sizeof(T));
  if (value.is_little_endian != (std::endian::native == std::endian::little)) {
    std::ranges::reverse(bytes);
  }
  return std::bit_cast<T>(bytes);
}

/// Calls `use` with the number that is stored at `index`, in the type it is stored in.
template <class Use>
Json with_stored(const MatArray& value, std::size_t index, Use use) {
  switch (value.stored) {
    case MatArray::kStoredInt8:
      return use(stored_at<std::int8_t>(value, index));
    case MatArray::kStoredUint8:
      return use(stored_at<std::uint8_t>(value, index));
    case MatArray::kStoredInt16:
      return use(stored_at<std::int16_t>(value, index));
    case MatArray::kStoredUint16:
      return use(stored_at<std::uint16_t>(value, index));
    case MatArray::kStoredInt32:
      return use(stored_at<std::int32_t>(value, index));
    case MatArray::kStoredUint32:
      return use(stored_at<std::uint32_t>(value, index));
    case MatArray::kStoredSingle:
      return use(stored_at<float>(value, index));
    case MatArray::kStoredInt64:
      return use(stored_at<std::int64_t>(value, index));
    case MatArray::kStoredUint64:
      return use(stored_at<std::uint64_t>(value, index));
    default:
      return use(stored_at<double>(value, index));
  }
}

template <class T>
Json number_at(const MatArray& value, std::size_t index) {
  return with_stored(value, index, [&value](auto stored) -> Json {
    using Stored = decltype(stored);
    if (value.is_logical) return stored != 0;
    if constexpr (std::is_floating_point_v<T>) {
      // A class holds what is stored in its own type or a smaller one.
      if constexpr (std::is_floating_point_v<Stored> && sizeof(Stored) > sizeof(T)) {
        throw std::invalid_argument("expected numbers of single precision, got others");
      } else {
        return to_json_number(static_cast<double>(static_cast<T>(stored)));
      }
    } else if constexpr (std::is_floating_point_v<Stored>) {
      throw std::invalid_argument("expected whole numbers, got others");
    } else {
      if (!std::in_range<T>(stored)) {
        throw std::invalid_argument("expected numbers that their class holds, got others");
      }
      return static_cast<T>(stored);
    }
  });
}

/// UTF-16 to UTF-8. A lone surrogate becomes a byte sequence that no decoder takes.
std::string from_utf16(std::span<const std::uint16_t> units) {
  std::string text;
  for (std::size_t i = 0; i < units.size(); ++i) {
    std::uint32_t code = units[i];
    if (code >= 0xD800 && code < 0xDC00 && i + 1 < units.size() && units[i + 1] >= 0xDC00 &&
        units[i + 1] < 0xE000) {
      code = 0x10000 + ((code - 0xD800) << 10) + (units[++i] - 0xDC00);
    }
    utf8::unchecked::append(code, std::back_inserter(text));
  }
  return text;
}

/// Char data `value` holds `rows` rows, stored column by column.
template <class Unit, class Decode>
Json text_rows(const MatArray& value, Decode decode) {
  // In UTF-8 a row can have more bytes than it has characters, so its length is not in the
  // dimensions.
  const std::size_t count = value.data.size() / sizeof(Unit);
  const std::size_t rows = value.dims[0];
  const std::size_t lines = rows > 1 && count % rows == 0 ? rows : 1;
  Json text = Json::array();
  for (std::size_t row = 0; row < lines; ++row) {
    std::vector<Unit> line;
    for (std::size_t i = row; i < count; i += lines) line.push_back(stored_at<Unit>(value, i));
    text.push_back(decode(std::span<const Unit>(line)));
  }
  return lines == 1 ? std::move(text[0]) : std::move(text);
}

Json text_of(const MatArray& value) {
  if (value.size == 0) return "";
  if (value.stored == MatArray::kStoredUint16 || value.stored == MatArray::kStoredUtf16) {
    return text_rows<std::uint16_t>(value, from_utf16);
  }
  return text_rows<char>(
      value, [](std::span<const char> bytes) { return std::string(bytes.begin(), bytes.end()); });
}

// Objects and arrays around the value that is read, as many as the strict reader of JSON takes.
constexpr int kDeepest = 32;

Json to_json(const MatArray& value, int depth);

[[noreturn]] void refuse_class(const MatArray& value) {
  throw std::invalid_argument("expected numbers, text, structs or cells, got MATLAB class " +
                              std::to_string(value.class_code));
}

void check_depth(int depth) {
  if (depth > kDeepest) {
    throw std::invalid_argument("expected at most " + std::to_string(kDeepest) +
                                " levels of nesting, got more");
  }
}

Json inner_to_json(const MatArray& value, std::size_t index, int depth) {
  return to_json(parse_mat_array(value.arrays[index], value.is_little_endian), depth);
}

Json struct_at(const MatArray& value, std::size_t index, int depth) {
  check_depth(depth + 1);
  Json object = Json::object();
  const std::size_t count = value.fields.size();
  for (std::size_t field = 0; field < count; ++field) {
    object[value.fields[field]] = inner_to_json(value, index * count + field, depth + 1);
  }
  return object;
}

Json element(const MatArray& value, std::size_t index, int depth) {
  if (value.is_complex) throw std::invalid_argument("expected a real value, got a complex one");
  switch (value.class_code) {
    case MatArray::kStruct:
      return struct_at(value, index, depth);
    case MatArray::kCell:
      return inner_to_json(value, index, depth);
    case MatArray::kDouble:
      return number_at<double>(value, index);
    case MatArray::kSingle:
      return number_at<float>(value, index);
    case MatArray::kInt8:
      return number_at<std::int8_t>(value, index);
    case MatArray::kUint8:
      return number_at<std::uint8_t>(value, index);
    case MatArray::kInt16:
      return number_at<std::int16_t>(value, index);
    case MatArray::kUint16:
      return number_at<std::uint16_t>(value, index);
    case MatArray::kInt32:
      return number_at<std::int32_t>(value, index);
    case MatArray::kUint32:
      return number_at<std::uint32_t>(value, index);
    case MatArray::kInt64:
      return number_at<std::int64_t>(value, index);
    case MatArray::kUint64:
      return number_at<std::uint64_t>(value, index);
    default:
      refuse_class(value);
  }
}

/// The part of an array of more than one dimension that starts at `offset`, from dimension
/// `dimension` on.
Json nested(const MatArray& value, std::size_t dimension, std::size_t offset, std::size_t stride,
            int depth) {
  if (dimension == value.dims.size()) return element(value, offset, depth);
  check_depth(depth + 1);
  Json part = Json::array();
  const std::size_t next_stride = stride * value.dims[dimension];
  for (std::size_t i = 0; i < value.dims[dimension]; ++i) {
    part.push_back(nested(value, dimension + 1, offset + i * stride, next_stride, depth + 1));
  }
  return part;
}

Json to_json(const MatArray& value, int depth) {
  const bool is_number =
      value.class_code >= MatArray::kDouble && value.class_code <= MatArray::kUint64;
  if (value.class_code == MatArray::kChar) return text_of(value);
  if (!is_number && value.class_code != MatArray::kStruct && value.class_code != MatArray::kCell) {
    refuse_class(value);
  }
  if (value.size == 0) return Json::array();
  if (value.size == 1 && value.class_code != MatArray::kCell) return element(value, 0, depth);
  if (std::ranges::count_if(value.dims, [](std::size_t dim) { return dim > 1; }) > 1) {
    return nested(value, 0, 0, 1, depth);
  }
  check_depth(depth + 1);
  Json array = Json::array();
  for (std::size_t i = 0; i < value.size; ++i) array.push_back(element(value, i, depth + 1));
  return array;
}

}  // namespace

Json mat_to_json(const MatArray& value) { return to_json(value, 0); }

Json mat_element_to_json(const MatArray& value, std::size_t index) {
  return element(value, index, 0);
}

std::optional<MatArray> mat_field(const MatArray& value, const std::string& name) {
  if (value.class_code != MatArray::kStruct || value.size != 1) return std::nullopt;
  const auto field = std::ranges::find(value.fields, name);
  if (field == value.fields.end()) return std::nullopt;
  const auto index = static_cast<std::size_t>(field - value.fields.begin());
  return parse_mat_array(value.arrays[index], value.is_little_endian);
}

}  // namespace eventgan
