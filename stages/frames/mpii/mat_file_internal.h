#pragma once

#include <matio.h>

#include <filesystem>
#include <memory>
#include <string>

namespace eventgan {

struct MatVariableDeleter {
  void operator()(matvar_t* variable) const { Mat_VarFree(variable); }
};
using MatVariable = std::unique_ptr<matvar_t, MatVariableDeleter>;

/// Reads the variable `name` with everything below it from a MATLAB version 5 file (what MATLAB's
/// `save -v6` and `-v7` write; compressed or not). The file is checked first, because matio takes a
/// truncated or damaged file without a word: its elements must fill it exactly, and every
/// compressed element must match its checksum. Throws InputError. Not thread safe: matio has state
/// of its own.
MatVariable read_mat_variable(const std::filesystem::path& file, const std::string& name);

}  // namespace eventgan
