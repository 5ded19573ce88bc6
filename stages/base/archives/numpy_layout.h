#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stages/base/archives/typed_array.h"

namespace eventgan {

/// A field of a structured dtype.
struct NumpyField {
  std::string name;   ///< empty: padding
  std::string descr;  ///< as NumpyLayout's, or "|V3" of padding
};

/// What numpy says about an array beside its bytes.
struct NumpyLayout {
  std::string descr;  ///< numpy's dtype string: "<f8", "|b1", "<U67"
  bool fortran_order = false;
  std::vector<std::size_t> shape;
  std::vector<NumpyField> fields = {};  ///< of a structured dtype, which has no `descr`
};

/// Turns numpy's bytes into values in C order. `data` must hold exactly the array: its size is
/// compared with the shape before anything is allocated. dtypes: those of parse_npy.
/// Throws std::runtime_error "expected X, got Y, in NAME".
TypedArray decode_numpy_elements(const NumpyLayout& layout, std::span<const std::byte> data,
                                 const std::string& name);

/// Throws as above unless the array is one of numbers or text that parse_npy takes, and has exactly
/// `size_bytes`. Gives the size of an element.
std::size_t require_numpy_size(const NumpyLayout& layout, std::uint64_t size_bytes,
                               const std::string& name);

/// What the header of a .npy file says, of which `bytes` may be the beginning alone; `data_begin`
/// is where the array's bytes start. Throws as above.
NumpyLayout parse_npy_header(std::span<const std::byte> bytes, const std::string& name,
                             std::size_t& data_begin);

/// Throws std::runtime_error "expected X, got Y, in NAME". What is not printable in `got`, which
/// may be foreign, becomes '?': a NUL would end the message before the name.
[[noreturn]] void refuse_numpy(const std::string& expected, std::string got,
                               const std::string& name);

}  // namespace eventgan
