#pragma once

#include <set>
#include <string>

#include "stages/archives/pickle/pickle.h"
#include "stages/archives/typed_array.h"

namespace eventgan {

/// The globals that a pickle of numpy arrays names, for PickleDocument; numpy 1 and 2, Python 2
/// and 3.
const std::set<std::string>& numpy_globals();

/// Whether the node is what numpy pickles an ndarray as.
bool is_pickled_array(const PickleNode& node);

/// The array that a pickled numpy.ndarray stands for; dtypes as parse_npy. Nothing is executed.
/// Throws std::runtime_error "expected X, got Y, in NAME" if the node is no such array.
TypedArray parse_pickled_array(const PickleNode& node, const std::string& name);

}  // namespace eventgan
