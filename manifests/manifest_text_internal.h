#pragma once

#include <string>

#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

/// A path: not empty, and without NUL, at which the file system would cut it.
std::string read_path(const StrictValue& value);

/// A part of file names: 1..64 letters, digits, ".", "_", "-", the first neither "." (hidden files
/// and temporaries) nor "-" (options of commands). Two of them, a number and a temporary's suffix
/// stay below the file systems' limit of 255 bytes.
std::string read_name(const StrictValue& value);

}  // namespace eventgan
