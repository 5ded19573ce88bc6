#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>

#include "stages/base/archives/typed_array.h"

namespace eventgan {

/// An array, or what lies below `index` of its first dimension, as nested JSON lists. Numbers keep
/// their value exactly; NaN and infinity become null.
nlohmann::ordered_json to_json(const TypedArray& array);
nlohmann::ordered_json to_json(const TypedArray& array, std::size_t index);

}  // namespace eventgan
