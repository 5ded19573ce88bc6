#include "stages/frames/human36m/detail/pose_table.h"

#include <fmt/format.h>

#include <cmath>

#include "manifests/values/text.h"
#include "stages/base/archives/array_json.h"

namespace eventgan {
namespace {

using Json = nlohmann::ordered_json;

std::string wanted_text(const std::vector<std::optional<std::size_t>>& shape) {
  const auto text = [](const auto& size) { return size ? std::to_string(*size) : "at least 1"; };
  return fmt::format("[{}]", joined(shape, ", ", text));
}

bool fits(const std::vector<std::size_t>& shape,
          const std::vector<std::optional<std::size_t>>& wanted) {
  if (shape.size() != wanted.size()) return false;
  for (std::size_t d = 0; d < shape.size(); ++d) {
    if (wanted[d] ? shape[d] != *wanted[d] : shape[d] == 0) return false;
  }
  return true;
}

}  // namespace

const TypedArray& TableColumns::need(const std::string& name,
                                     const std::vector<std::optional<std::size_t>>& shape,
                                     bool text) const {
  const auto found = arrays_.find(name);
  const std::string wanted = (text ? "text " : "numbers ") + wanted_text(shape);
  const auto fail = [&](const std::string& got) {
    throw InputError("expected " + wanted + ", got " + got + ", in " + file_ + " (" + name + ")");
  };
  if (found == arrays_.end()) fail("no such array");
  const TypedArray& array = found->second;
  if (array.is_text() != text || !fits(array.shape, shape)) {
    fail((array.is_text() ? "text " : "numbers ") + array.shape_text());
  }
  return array;
}

std::int64_t TableColumns::whole_number(const std::string& name, std::size_t row) const {
  const double value = arrays_.at(name).number(row);
  if (!(value >= 0 && value < 1e9) || value != std::floor(value)) {
    throw InputError("expected a whole number in [0, 10^9), got " + std::to_string(value) +
                     ", in " + file_ + " (" + name + ", row " + std::to_string(row) + ")");
  }
  return static_cast<std::int64_t>(value);
}

std::vector<double> TableColumns::row_of(const std::string& name, std::size_t row) const {
  const TypedArray& array = arrays_.at(name);
  const std::size_t width = array.size() / array.shape.at(0);
  std::vector<double> values(width);
  for (std::size_t i = 0; i < width; ++i) values[i] = array.number(row * width + i);
  return values;
}

std::optional<SampleFault> TableColumns::not_finite(const std::vector<double>& values,
                                                    const std::string& name,
                                                    std::size_t row) const {
  for (const double value : values) {
    if (std::isfinite(value)) continue;
    return SampleFault{"expected finite numbers, got " + std::to_string(value) + ", in " + file_ +
                       " (" + name + ", row " + std::to_string(row) + ")"};
  }
  return std::nullopt;
}

Json TableColumns::fields(std::size_t row, std::size_t row_count,
                          const std::string& but_prefix) const {
  Json object = Json::object();
  for (const auto& [name, array] : arrays_) {
    if (!but_prefix.empty() && name.starts_with(but_prefix)) continue;
    if (array.shape.empty() || array.shape[0] != row_count) continue;
    object[name] = to_json(array, row);
  }
  return object;
}

}  // namespace eventgan
