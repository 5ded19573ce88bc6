#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "stages/frames/mpii/mat_json_internal.h"

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

template <class T>
Json number_at(matvar_t* value, std::size_t index) {
  const T number = static_cast<const T*>(value->data)[index];
  if (value->isLogical) return number != 0;
  if constexpr (std::is_floating_point_v<T>) return to_json_number(number);
  return number;
}

void append_utf8(std::string& text, std::uint32_t code) {
  const auto tail = [&](int shift) { text += static_cast<char>(0x80 | ((code >> shift) & 0x3F)); };
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xC0 | code >> 6);
    tail(0);
  } else if (code < 0x10000) {
    text += static_cast<char>(0xE0 | code >> 12);
    tail(6);
    tail(0);
  } else {
    text += static_cast<char>(0xF0 | code >> 18);
    tail(12);
    tail(6);
    tail(0);
  }
}

/// UTF-16 to UTF-8. A surrogate without its partner becomes a byte sequence that no decoder takes.
std::string from_utf16(std::span<const std::uint16_t> units) {
  std::string text;
  for (std::size_t i = 0; i < units.size(); ++i) {
    std::uint32_t code = units[i];
    if (code >= 0xD800 && code < 0xDC00 && i + 1 < units.size() && units[i + 1] >= 0xDC00 &&
        units[i + 1] < 0xE000) {
      code = 0x10000 + ((code - 0xD800) << 10) + (units[++i] - 0xDC00);
    }
    append_utf8(text, code);
  }
  return text;
}

/// Char data `value` holds `rows` rows, stored column by column.
template <class Unit, class Decode>
Json text_rows(matvar_t* value, Decode decode) {
  const auto* units = static_cast<const Unit*>(value->data);
  // In UTF-8 a row can have more bytes than it has characters, so its length is not in the
  // dimensions.
  const std::size_t count = value->nbytes / sizeof(Unit);
  const std::size_t rows = value->rank > 0 && value->dims[0] > 0 ? value->dims[0] : 1;
  if (rows == 1 || count % rows != 0) return decode(std::span(units, count));
  Json lines = Json::array();
  for (std::size_t row = 0; row < rows; ++row) {
    std::vector<Unit> line;
    for (std::size_t i = row; i < count; i += rows) line.push_back(units[i]);
    lines.push_back(decode(std::span<const Unit>(line)));
  }
  return lines;
}

Json text_of(matvar_t* value) {
  if (mat_size(value) == 0 || value->data == nullptr) return "";
  switch (value->data_type) {
    case MAT_T_UINT16:
    case MAT_T_UTF16:
      return text_rows<std::uint16_t>(value, from_utf16);
    default:
      if (value->data_size != 1) throw std::invalid_argument("expected text in UTF-8 or UTF-16");
      return text_rows<char>(value, [](std::span<const char> bytes) {
        return std::string(bytes.begin(), bytes.end());
      });
  }
}

Json struct_at(matvar_t* value, std::size_t index) {
  Json object = Json::object();
  char* const* names = Mat_VarGetStructFieldnames(value);
  const std::size_t count = Mat_VarGetNumberOfFields(value);
  for (std::size_t field = 0; field < count; ++field) {
    object[names[field]] = mat_to_json(Mat_VarGetStructFieldByIndex(value, field, index));
  }
  return object;
}

/// The part of an array of more than one dimension that starts at `offset`, from dimension
/// `dimension` on.
Json nested(matvar_t* value, int dimension, std::size_t offset, std::size_t stride) {
  if (dimension == value->rank) return mat_element_to_json(value, offset);
  Json part = Json::array();
  const std::size_t next_stride = stride * value->dims[dimension];
  for (std::size_t i = 0; i < value->dims[dimension]; ++i) {
    part.push_back(nested(value, dimension + 1, offset + i * stride, next_stride));
  }
  return part;
}

}  // namespace

std::size_t mat_size(matvar_t* value) {
  if (value == nullptr || value->rank == 0) return 0;
  std::size_t size = 1;
  for (int i = 0; i < value->rank; ++i) size *= value->dims[i];
  return size;
}

Json mat_element_to_json(matvar_t* value, std::size_t index) {
  if (value->isComplex) throw std::invalid_argument("expected a real value, got a complex one");
  if (value->data == nullptr)
    throw std::invalid_argument("expected data, got an array without any");
  switch (value->class_type) {
    case MAT_C_STRUCT:
      return struct_at(value, index);
    case MAT_C_CELL:
      return mat_to_json(Mat_VarGetCell(value, static_cast<int>(index)));
    case MAT_C_DOUBLE:
      return number_at<double>(value, index);
    case MAT_C_SINGLE:
      return number_at<float>(value, index);
    case MAT_C_INT8:
      return number_at<std::int8_t>(value, index);
    case MAT_C_UINT8:
      return number_at<std::uint8_t>(value, index);
    case MAT_C_INT16:
      return number_at<std::int16_t>(value, index);
    case MAT_C_UINT16:
      return number_at<std::uint16_t>(value, index);
    case MAT_C_INT32:
      return number_at<std::int32_t>(value, index);
    case MAT_C_UINT32:
      return number_at<std::uint32_t>(value, index);
    case MAT_C_INT64:
      return number_at<std::int64_t>(value, index);
    case MAT_C_UINT64:
      return number_at<std::uint64_t>(value, index);
    default:
      throw std::invalid_argument("expected numbers, text, structs or cells, got MATLAB class " +
                                  std::to_string(value->class_type));
  }
}

Json mat_to_json(matvar_t* value) {
  if (value == nullptr) return Json::array();
  if (value->class_type == MAT_C_CHAR) return text_of(value);
  const std::size_t size = mat_size(value);
  if (size == 0) return Json::array();
  if (size == 1 && value->class_type != MAT_C_CELL) return mat_element_to_json(value, 0);
  int wide = 0;
  for (int i = 0; i < value->rank; ++i) wide += value->dims[i] > 1;
  if (wide > 1) return nested(value, 0, 0, 1);
  Json array = Json::array();
  for (std::size_t i = 0; i < size; ++i) array.push_back(mat_element_to_json(value, i));
  return array;
}

matvar_t* mat_field(matvar_t* value, const std::string& name) {
  if (value == nullptr || value->class_type != MAT_C_STRUCT || mat_size(value) != 1) return nullptr;
  return Mat_VarGetStructFieldByName(value, name.c_str(), 0);
}

}  // namespace eventgan
