#include "pipeline/runtime/threads.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/partitioner.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <ctime>

#include "pipeline/runtime/control_groups.h"
#include "pipeline/runtime/handover.h"

namespace eventgan {

int thread_count(int requested, const std::filesystem::path& root) {
  if (requested > 0) return requested;
  const int cores = oneapi::tbb::info::default_concurrency();  // minds the affinity
  return static_cast<int>(std::clamp(std::ceil(control_group_limits(root).processors), 1.0,
                                     std::max(1.0, cores * 1.0)));
}

void for_each_index(std::size_t count, int threads, const std::function<void(std::size_t)>& work) {
  if (threads == 1) {  // a budget of one would hold for what `work` calls, too
    for (std::size_t i = 0; i < count; ++i) work(i);
    return;
  }
  const oneapi::tbb::global_control budget(oneapi::tbb::global_control::max_allowed_parallelism,
                                           static_cast<std::size_t>(threads));
  oneapi::tbb::task_arena arena(threads);
  const Tasks tasks;
  // A task an index: each is long, and what waited behind one in its task could not be taken over.
  arena.execute([&] {
    oneapi::tbb::parallel_for(
        oneapi::tbb::blocked_range<std::size_t>(0, count),
        [&](const auto& range) {
          const char own = 0;  // of this task alone, unlike `range`, whose memory oneTBB uses again
          const Tasks::Work task(tasks, &own);
          for (std::size_t i = range.begin(); i != range.end(); ++i) work(i);
        },
        oneapi::tbb::simple_partitioner());
  });
}

namespace {

std::int64_t now_ns(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

std::int64_t thread_processor_ns() { return now_ns(CLOCK_THREAD_CPUTIME_ID); }

std::int64_t process_processor_ns() { return now_ns(CLOCK_PROCESS_CPUTIME_ID); }

}  // namespace eventgan
