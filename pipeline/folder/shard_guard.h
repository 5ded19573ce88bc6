#pragma once

#include <filesystem>
#include <functional>

namespace eventgan {

/// Runs `read`, which opens the file `shard` and prints what it finds, so that a damaged file ends
/// in an error and not in a crash or a hang of HDF5, which does not promise to survive one.
///
/// If a commit record of the shard is beside it, its size and SHA-256 are compared first. A file
/// that no commit record vouches for is read by a child process with a limit to the processor's
/// time, of which reading takes no more however slow the disk, and one to its memory. The child is
/// this process, forked, since what HDF5 reads is wanted in many places; so this must be called
/// before the process starts threads (a thread's locks stay locked in the child), and before it
/// uses HDF5.
///
/// Returns what `read` returns, or in the child the exit code of what it throws, after its message.
/// Throws std::runtime_error naming the file if it is damaged, or if a signal from outside ends the
/// child; what `read` throws where there was no need of a child.
int read_guarded(const std::filesystem::path& shard, const std::function<int()>& read);

/// The same for what reads parts of many shards, which to hash would take hours: always in such a
/// child. `where`: their folder, for messages.
int read_apart(const std::filesystem::path& where, const std::function<int()>& read);

/// Between the steps of `read`: the limit of time counts again, or not at all where HDF5 is not at
/// work (frames may take as long as they take). Outside of such a child they do nothing.
void renew_time_limit();
void lift_time_limit();

}  // namespace eventgan
