#pragma once

namespace eventgan {

/// Number of threads to use for a request (`--threads`): itself, or all cores for 0.
int thread_count(int requested);

}  // namespace eventgan
