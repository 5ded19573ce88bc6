#pragma once

#include <matio.h>

#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>

namespace eventgan {

/// A MATLAB value as JSON, by the rules of MATLAB's own `jsonencode`:
///   number           number, or the whole number without a fraction if its value is whole
///   logical          true, false
///   NaN, infinity    null, since JSON has neither
///   char row         string; '' is "", so that it can be told from []
///   1x1 struct       object, fields in their order
///   struct array, cell, array of numbers   array; of arrays, row by row, if it is no vector
///   empty, or absent (null pointer)        []
/// Text that is no valid Unicode is kept with U+FFFD in place of what is wrong. Throws
/// std::invalid_argument for a class that MPII does not use (complex, sparse, object, function).
/// `value` is not changed; it is not const only because matio asks so.
nlohmann::ordered_json mat_to_json(matvar_t* value);

/// Number of elements: product of the dimensions; 0 for a null pointer.
std::size_t mat_size(matvar_t* value);

/// Element `index`, counted in MATLAB's order (first dimension fastest): of a struct array an
/// object, of a cell its content, of numbers a number. `index` must be below mat_size.
nlohmann::ordered_json mat_element_to_json(matvar_t* value, std::size_t index);

/// Field `name` of a 1x1 struct; null if `value` is no such struct or has no such field.
matvar_t* mat_field(matvar_t* value, const std::string& name);

}  // namespace eventgan
