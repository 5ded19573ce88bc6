#pragma once

#include <cstdint>

namespace eventgan {

/// Processor time that the calling thread has used so far, in nanoseconds: waiting is not in it.
/// Thread safe.
std::int64_t thread_processor_ns();

/// The same of all threads of the process together.
std::int64_t process_processor_ns();

}  // namespace eventgan
