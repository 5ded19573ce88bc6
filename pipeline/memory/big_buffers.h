#pragma once

namespace eventgan {

/// Lets the process keep the big buffers it frees, for their next use. Without it glibc gives them
/// back to the system on every free and faults them in again; volumes and LibTorch's tensors are
/// such buffers. All threads share one arena then: buffers travel from thread to thread here, and
/// with an arena for each, what is kept grows slowly for thousands of pairs.
/// Call it first in `main`: what other arenas and mappings hold by then stays there. Never throws.
void keep_big_buffers();

}  // namespace eventgan
