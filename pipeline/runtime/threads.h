#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>

namespace eventgan {

/// Number of threads to use for a request (`--threads`): itself, or for 0 one for each core that
/// this process may use, by its affinity (taskset, a cpuset) and by its control groups' processor
/// time (control_group_limits of `root`), of which a started one counts as a core. Thread safe.
int thread_count(int requested, const std::filesystem::path& root = "/");

/// Calls `work` with each of 0 .. count - 1 on up to `threads` threads, the calling one included,
/// which may be more than there are cores: many waits for a network file system fit side by side.
/// The first exception that leaves `work` is rethrown; then some indexes have not had their turn.
/// A call within `work` has no more threads than this one, unless this one has a single thread.
void for_each_index(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

/// Processor time that the calling thread has used so far, in nanoseconds: waiting is not in it.
/// Thread safe.
std::int64_t thread_processor_ns();

/// The same of all threads of the process together.
std::int64_t process_processor_ns();

}  // namespace eventgan
