#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "manifests/strict_json/strict_json_internal.h"

namespace eventgan {

// What the manifests of conversion, training and simulation share.

/// A path: not empty, and without NUL, at which the file system would cut it.
std::string read_path(const StrictValue& value);

/// A part of file names: 1..64 letters, digits, ".", "_", "-", the first neither "." (hidden files
/// and temporaries) nor "-" (options of commands). Two of them, a number and a temporary's suffix
/// stay below the file systems' limit of 255 bytes.
std::string read_name(const StrictValue& value);
bool is_name(std::string_view text);

/// 0..2^63-1.
std::uint64_t read_seed(const StrictValue& value);

/// A manifest file, byte for byte. Throws InputError if it cannot be read.
std::string read_manifest_text(const std::filesystem::path& file);

/// Absolute folder that the relative paths of this manifest file start at.
std::filesystem::path manifest_folder(const std::filesystem::path& file);

}  // namespace eventgan
