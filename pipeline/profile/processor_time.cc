#include "pipeline/profile/processor_time.h"

#include <ctime>

namespace eventgan {
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
