#include "pipeline/profile/processor_time.h"

#include <gtest/gtest.h>

#include <thread>

namespace eventgan {
namespace {

/// Works until its thread has used a millisecond more.
void work() {
  const std::int64_t start_ns = thread_processor_ns();
  while (thread_processor_ns() - start_ns < 1'000'000) {
  }
}

TEST(ProcessorTime, OfTheProcessHoldsThatOfEveryThread) {
  const std::int64_t thread_ns = thread_processor_ns();
  const std::int64_t process_ns = process_processor_ns();
  work();
  std::thread(work).join();
  EXPECT_GE(thread_processor_ns() - thread_ns, 1'000'000);
  EXPECT_GE(process_processor_ns() - process_ns, 2'000'000);
}

TEST(ProcessorTime, OfAThreadBeginsWithIt) {
  work();
  const std::int64_t here_ns = thread_processor_ns();
  std::int64_t there_ns = here_ns;
  std::thread([&] { there_ns = thread_processor_ns(); }).join();
  EXPECT_LT(there_ns, here_ns);
}

}  // namespace
}  // namespace eventgan
