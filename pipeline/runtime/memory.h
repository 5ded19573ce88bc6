#pragma once

#include <cstddef>
#include <filesystem>

namespace eventgan {

/// Memory that this process may use, in bytes: the machine's, or what its control groups
/// (control_group_limits of `root`) or its own limit of address space (ulimit -v) grant if that is
/// less. Thread safe.
std::size_t memory_limit_bytes(const std::filesystem::path& root = "/");

/// Gives freed memory back to the system and lets peak_memory_bytes begin again. False where the
/// kernel does not allow that: then the peak is that of the process's whole life. Thread safe.
bool restart_peak_memory();

/// The most memory that was resident in this process since restart_peak_memory, in bytes; 0 where
/// the system does not tell. Thread safe.
std::size_t peak_memory_bytes();

/// Lets the process keep the big buffers it frees, for their next use. Without it glibc gives them
/// back to the system on every free and faults them in again; volumes and LibTorch's tensors are
/// such buffers. All threads share one arena then: buffers travel from thread to thread here, and
/// with an arena for each, what is kept grows slowly for thousands of pairs.
/// Call it first in `main`: what other arenas and mappings hold by then stays there. Never throws.
void keep_big_buffers();

}  // namespace eventgan
