#pragma once

#include <cstddef>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "stages/base/archives/mat_file.h"

namespace eventgan {

/// A MATLAB value as JSON, by the rules of MATLAB's own `jsonencode`:
///   number           number, or the whole number without a fraction if its value is whole
///   logical          true, false
///   NaN, infinity    null, since JSON has neither
///   char row         string; '' is "", so that it can be told from []
///   1x1 struct       object, fields in their order
///   struct array, cell, array of numbers   array; of arrays, row by row, if it is no vector
///   empty            []
/// Text that is no valid Unicode is kept with U+FFFD in place of what is wrong. Throws
/// std::invalid_argument for a class that MPII does not use (complex, sparse, object, function), a
/// number that its class does not hold, an array in it that is damaged, and more than 32 levels of
/// objects and arrays.
nlohmann::ordered_json mat_to_json(const MatArray& value);

/// Element `index`, counted in MATLAB's order (first dimension fastest): of a struct array an
/// object, of a cell its content, of numbers a number. `index` must be below value.size. Throws as
/// above.
nlohmann::ordered_json mat_element_to_json(const MatArray& value, std::size_t index);

/// Field `name` of a 1x1 struct; none if `value` is no such struct or has no such field. Throws as
/// above.
std::optional<MatArray> mat_field(const MatArray& value, const std::string& name);

}  // namespace eventgan
