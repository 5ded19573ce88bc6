#pragma once

#include <cstddef>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "stages/base/archives/pickle.h"
#include "stages/base/archives/typed_array.h"

namespace eventgan {

/// Reads a .npy file (a member of an .npz) of format version 1-3: dtypes <f4 <f8, <i and <u of 1,
/// 2, 4 and 8 bytes (of <u8 what int64 holds), |b1, text as <U or |S; C or Fortran order. The data
/// must have the size that the header tells. Object arrays, which are pickles, are refused. Thread
/// safe. Throws std::runtime_error "expected X, got Y, in NAME".
TypedArray parse_npy(std::span<const std::byte> bytes, const std::string& name);

/// A field of a structured array.
struct NamedArray {
  std::string name;
  TypedArray values;  ///< [N]
};

/// The fields of a .npy file that holds a structured array [N], in its order. Throws as parse_npy.
std::vector<NamedArray> parse_npy_fields(std::span<const std::byte> bytes, const std::string& name);

/// A .npy file of format version 1: `dtype` is numpy's ("<f2", "|u1"), `values` the array in C
/// order, little endian. Throws std::invalid_argument if there are not as many bytes as shape and
/// dtype say. Thread safe, as the others.
std::string npy_file(std::string_view dtype, const std::vector<std::size_t>& shape,
                     std::span<const std::byte> values);

/// The same of a vector of numbers.
template <class Number>
std::string npy_file(std::string_view dtype, const std::vector<std::size_t>& shape,
                     const std::vector<Number>& values) {
  return npy_file(dtype, shape, std::as_bytes(std::span(values)));
}

/// The same of a list of records: `descr` is numpy's list of (name, type), `values` a record after
/// the other, `record_bytes` each.
std::string npy_records(std::string_view descr, std::size_t record_bytes, std::string_view values);

/// A list of text, "<U" of the longest one; what is not UTF-8 becomes U+FFFD.
std::string npy_texts(const std::vector<std::string>& texts);

/// The globals that a pickle of numpy arrays names, for PickleDocument; numpy 1 and 2, Python 2
/// and 3.
const std::set<std::string>& numpy_globals();

/// Whether the node is what numpy pickles an ndarray as.
bool is_pickled_array(const PickleNode& node);

/// The array that a pickled numpy.ndarray stands for; dtypes as parse_npy. Nothing is executed.
/// Throws std::runtime_error "expected X, got Y, in NAME" if the node is no such array.
TypedArray parse_pickled_array(const PickleNode& node, const std::string& name);

}  // namespace eventgan
