#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "stages/base/archives/typed_array.h"

namespace eventgan {

/// What numpy says about an array beside its bytes.
struct NumpyLayout {
  std::string descr;  ///< numpy's dtype string: "<f8", "|b1", "<U67"
  bool fortran_order = false;
  std::vector<std::size_t> shape;
};

/// Turns numpy's bytes into values in C order. `data` must hold exactly the array: its size is
/// compared with the shape before anything is allocated. dtypes: <f4 <f8 <i4 <i8 |u1 |b1 <UN |SN.
/// Throws std::runtime_error "expected X, got Y, in NAME".
TypedArray decode_numpy_elements(const NumpyLayout& layout, std::span<const std::byte> data,
                                 const std::string& name);

/// Throws std::runtime_error "expected X, got Y, in NAME". What is not printable in `got`, which
/// may be foreign, becomes '?': a NUL would end the message before the name.
[[noreturn]] void refuse_numpy(const std::string& expected, std::string got,
                               const std::string& name);

}  // namespace eventgan
