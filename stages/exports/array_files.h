#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace eventgan {

// Files as bytes, the same for the same content: no times, no owners. All thread safe.

/// A .npz file: a zip of NAME.npy members (npy_file), deflated, dated 1980-01-01. Throws
/// std::runtime_error if libzip fails.
std::string npz_file(const std::vector<std::pair<std::string, std::string>>& arrays);

/// One member of a tar file (POSIX ustar): header, bytes, padding; mode 0644, owner 0, time 0.
/// Throws std::invalid_argument for a name that is empty or longer than 100 bytes, or 8 GiB and
/// more.
std::string tar_member(std::string_view name, std::string_view bytes);

/// What is at a tar file's end.
std::string tar_end();

}  // namespace eventgan
