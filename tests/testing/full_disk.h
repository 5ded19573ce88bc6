#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace eventgan::testing {

/// Runs `work` in a child process where no file can grow beyond `limit_bytes` (writes then fail
/// with "File too large", as they do with "No space left on device" on a full disk). Gives the
/// message of the std::runtime_error that it threw; "no error" if it threw none; "crashed" if the
/// child did not end by itself, its exit handlers included.
std::string error_on_full_disk(std::size_t limit_bytes, const std::function<void()>& work);

/// Names of everything in a folder, hidden files too, sorted.
std::vector<std::string> names_in(const std::filesystem::path& folder);

}  // namespace eventgan::testing
