#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "stages/archives/typed_array.h"

namespace eventgan {

/// Reads a .npy file (a member of an .npz) of format version 1-3: dtypes <f4 <f8 <i4 <i8 |u1 |b1,
/// text as <U or |S; C or Fortran order. The data must have the size that the header tells. Object
/// arrays, which are pickles, are refused. Thread safe. Throws std::runtime_error "expected X, got
/// Y, in NAME".
TypedArray parse_npy(std::span<const std::byte> bytes, const std::string& name);

}  // namespace eventgan
