#include "pipeline/stopping/stop_signal.h"

#include <gtest/gtest.h>

#include <array>

namespace eventgan {
namespace {

constexpr std::array kSignals{SIGINT, SIGTERM, SIGUSR1};

struct sigaction action_of(int number) {
  struct sigaction action {};
  sigaction(number, nullptr, &action);
  return action;
}

TEST(StopSignal, EachKindIsARequest) {
  for (const int number : kSignals) {
    const StopSignal signal;
    EXPECT_FALSE(signal.requested());
    EXPECT_FALSE(signal.seconds_since_request());
    std::raise(number);
    EXPECT_TRUE(signal.requested());
    EXPECT_GE(signal.seconds_since_request(), 0);
  }
}

TEST(StopSignal, CountsFromTheFirst) {
  const StopSignal signal;
  std::raise(SIGUSR1);
  const double first_s = signal.seconds_since_request().value();
  for (int i = 0; i < 3; ++i) {  // schedulers repeat them
    std::raise(SIGTERM);
    std::raise(SIGUSR1);
  }
  EXPECT_GE(signal.seconds_since_request(), first_s);
}

TEST(StopSignal, ASecondInterruptEndsTheProcess) {
  const auto interrupt_twice = [] {
    const StopSignal signal;
    std::raise(SIGTERM);  // does not count as the first
    std::raise(SIGINT);
    if (signal.requested()) std::raise(SIGINT);
  };
  EXPECT_EXIT(interrupt_twice(), ::testing::KilledBySignal(SIGINT), "");
}

TEST(StopSignal, LeavesSignalsAsTheyWere) {
  std::array<struct sigaction, 3> before{};
  for (std::size_t i = 0; i < kSignals.size(); ++i) before[i] = action_of(kSignals[i]);
  { const StopSignal signal; }
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    EXPECT_EQ(action_of(kSignals[i]).sa_handler, before[i].sa_handler);
  }
}

}  // namespace
}  // namespace eventgan
