#include "pipeline/threads/thread_count.h"

#include <algorithm>
#include <thread>

namespace eventgan {

int thread_count(int requested) {
  if (requested > 0) return requested;
  // The system may not know, and says 0 then.
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

}  // namespace eventgan
