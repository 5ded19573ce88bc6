#include "pipeline/threads/for_each_index.h"

#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

namespace eventgan {

void for_each_index(std::size_t count, int threads, const std::function<void(std::size_t)>& work) {
  const oneapi::tbb::global_control budget(oneapi::tbb::global_control::max_allowed_parallelism,
                                           static_cast<std::size_t>(threads));
  oneapi::tbb::task_arena arena(threads);
  arena.execute([&] { oneapi::tbb::parallel_for(std::size_t{0}, count, work); });
}

}  // namespace eventgan
