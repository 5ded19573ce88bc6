#pragma once

#include <cstddef>
#include <set>
#include <span>
#include <string>

#include "stages/base/archives/pickle.h"
#include "stages/base/archives/typed_array.h"

namespace eventgan {

/// Reads a .npy file (a member of an .npz) of format version 1-3: dtypes <f4 <f8 <i4 <i8 |u1 |b1,
/// text as <U or |S; C or Fortran order. The data must have the size that the header tells. Object
/// arrays, which are pickles, are refused. Thread safe. Throws std::runtime_error "expected X, got
/// Y, in NAME".
TypedArray parse_npy(std::span<const std::byte> bytes, const std::string& name);

/// The globals that a pickle of numpy arrays names, for PickleDocument; numpy 1 and 2, Python 2
/// and 3.
const std::set<std::string>& numpy_globals();

/// Whether the node is what numpy pickles an ndarray as.
bool is_pickled_array(const PickleNode& node);

/// The array that a pickled numpy.ndarray stands for; dtypes as parse_npy. Nothing is executed.
/// Throws std::runtime_error "expected X, got Y, in NAME" if the node is no such array.
TypedArray parse_pickled_array(const PickleNode& node, const std::string& name);

}  // namespace eventgan
