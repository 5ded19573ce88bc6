#include "pipeline/stopping/stop_signal.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(StopSignal, CatchesTheFirstOfEachKind) {
  for (const int number : {SIGINT, SIGTERM}) {
    const StopSignal signal;
    EXPECT_FALSE(signal.requested());
    std::raise(number);
    EXPECT_TRUE(signal.requested());
    struct sigaction now {};
    sigaction(number, nullptr, &now);
    EXPECT_EQ(now.sa_handler, SIG_DFL);  // a second one ends the process
  }
}

TEST(StopSignal, LeavesSignalsAsTheyWere) {
  struct sigaction before {};
  sigaction(SIGTERM, nullptr, &before);
  { const StopSignal signal; }
  struct sigaction after {};
  sigaction(SIGTERM, nullptr, &after);
  EXPECT_EQ(before.sa_handler, after.sa_handler);
}

}  // namespace
}  // namespace eventgan
