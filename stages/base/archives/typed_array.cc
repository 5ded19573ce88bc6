#include "stages/base/archives/typed_array.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <type_traits>

#include "stages/base/archives/array_json.h"

namespace eventgan {

std::size_t TypedArray::size() const {
  return std::visit([](const auto& elements) { return elements.size(); }, values);
}

double TypedArray::number(std::size_t index) const {
  return std::visit(
      [index](const auto& elements) -> double {
        using Element = typename std::decay_t<decltype(elements)>::value_type;
        if constexpr (std::is_same_v<Element, std::string>) {
          throw std::invalid_argument("expected an array of numbers, got text");
        } else {
          return static_cast<double>(elements.at(index));
        }
      },
      values);
}

const std::string& TypedArray::text(std::size_t index) const {
  const auto* elements = std::get_if<std::vector<std::string>>(&values);
  if (elements == nullptr) throw std::invalid_argument("expected an array of text, got numbers");
  return elements->at(index);
}

std::string TypedArray::shape_text() const { return fmt::format("[{}]", fmt::join(shape, ", ")); }

namespace {

using Json = nlohmann::ordered_json;

Json element(const TypedArray& array, std::size_t index) {
  return std::visit(
      [index](const auto& elements) -> Json {
        using Value = typename std::decay_t<decltype(elements)>::value_type;
        const Value value = elements[index];
        if constexpr (std::is_floating_point_v<Value>) {
          if (!std::isfinite(value)) return nullptr;
          return static_cast<double>(value);
        } else {
          return value;
        }
      },
      array.values);
}

// The part of the array from dimension `depth` on that starts at element `next`, which moves on.
Json nested(const TypedArray& array, std::size_t depth, std::size_t& next) {
  if (depth == array.shape.size()) return element(array, next++);
  Json list = Json::array();
  for (std::size_t i = 0; i < array.shape[depth]; ++i) {
    list.push_back(nested(array, depth + 1, next));
  }
  return list;
}

}  // namespace

Json to_json(const TypedArray& array) {
  std::size_t next = 0;
  return nested(array, 0, next);
}

Json to_json(const TypedArray& array, std::size_t index) {
  std::size_t next = index * (array.size() / array.shape.at(0));
  return nested(array, 1, next);
}

}  // namespace eventgan
