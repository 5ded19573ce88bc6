#include "stages/archives/typed_array.h"

#include <stdexcept>
#include <type_traits>

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

std::string TypedArray::shape_text() const {
  std::string text;
  for (const std::size_t size : shape) text += (text.empty() ? "" : ", ") + std::to_string(size);
  return "[" + text + "]";
}

}  // namespace eventgan
