#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace eventgan {

/// An array of numbers, truth values or text as a data file holds it, in the file's own precision.
struct TypedArray {
  std::vector<std::size_t> shape;  ///< empty for a single value
  /// The elements in C order. Text is UTF-8.
  std::variant<std::vector<double>, std::vector<float>, std::vector<std::int64_t>,
               std::vector<std::int32_t>, std::vector<std::uint8_t>, std::vector<bool>,
               std::vector<std::string>>
      values;

  /// How many elements: the product of `shape`.
  std::size_t size() const;

  bool is_text() const { return std::holds_alternative<std::vector<std::string>>(values); }

  /// Element `index` as a number; truth values are 0 and 1. Throws std::invalid_argument for text,
  /// std::out_of_range beyond the end.
  double number(std::size_t index) const;

  /// Element `index` of an array of text; throws likewise.
  const std::string& text(std::size_t index) const;

  /// The shape for messages: "[4, 17, 3]".
  std::string shape_text() const;
};

}  // namespace eventgan
