#pragma once

#include <cstddef>
#include <functional>

namespace eventgan {

/// Calls `work` with each of 0 .. count - 1 on up to `threads` threads, the calling one included,
/// which may be more than there are cores: many waits for a network file system fit side by side.
/// The first exception that leaves `work` is rethrown; then some indexes have not had their turn.
void for_each_index(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

}  // namespace eventgan
