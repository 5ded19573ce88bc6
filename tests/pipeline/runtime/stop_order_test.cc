#include <gtest/gtest.h>

#include <array>
#include <chrono>

#include "pipeline/runtime/stopping.h"

namespace eventgan {
namespace {

using std::chrono::seconds;

constexpr double kGrace_s = 20;

/// 5 samples left of 2 s each, one to spare, a commit of 3 s and an abort of 1 s: 16 s.
constexpr WorkLeft kOpen{5, 2, 3, 1};

TEST(StopOrder, FinishesAShardWhereTheTimeIsEnough) {
  EXPECT_EQ(stop_order(std::nullopt, kGrace_s, kOpen), StopOrder::kGoOn);
  EXPECT_EQ(stop_order(std::nullopt, 0, std::nullopt), StopOrder::kGoOn);
  EXPECT_EQ(stop_order(0, kGrace_s, kOpen), StopOrder::kFinishShard);
  EXPECT_EQ(stop_order(4, kGrace_s, kOpen), StopOrder::kFinishShard);
  EXPECT_EQ(stop_order(4.1, kGrace_s, kOpen), StopOrder::kAbort);
  for (const WorkLeft slower :
       {WorkLeft{6, 2, 3, 1}, WorkLeft{5, 2.5, 3, 1}, WorkLeft{5, 2, 4, 1}, WorkLeft{5, 2, 3, 2}}) {
    EXPECT_EQ(stop_order(4, kGrace_s, slower), StopOrder::kAbort);
  }
  EXPECT_EQ(stop_order(0, kGrace_s, std::nullopt), StopOrder::kAbort);
  EXPECT_EQ(stop_order(0.001, 0, WorkLeft{0, 0, 0, 0}), StopOrder::kAbort);
  EXPECT_EQ(stop_order(19, kGrace_s, WorkLeft{0, 0.1, 0.5, 0.1}), StopOrder::kFinishShard);
}

/// Three threads, and a clock that is moved by hand.
class ShardPaceTest : public ::testing::Test {
 protected:
  std::chrono::steady_clock::time_point now_;
  ShardPace pace_{3, [this] { return now_; }};
};

TEST_F(ShardPaceTest, NothingIsOpenBeforeTheFirstShardAndBetweenShards) {
  EXPECT_FALSE(pace_.work_left());
  pace_.open(1);
  EXPECT_TRUE(pace_.work_left());
  pace_.take(10);
  EXPECT_TRUE(pace_.work_left());  // not committed yet
  pace_.begin_commit();
  pace_.close();
  EXPECT_FALSE(pace_.work_left());
}

TEST_F(ShardPaceTest, TheRateIsThatOfTheRunSoFar) {
  pace_.open(10);
  for (int i = 0; i < 4; ++i) pace_.take(1);
  now_ += seconds(8);
  EXPECT_EQ(pace_.work_left()->samples, 6);
  EXPECT_DOUBLE_EQ(pace_.work_left()->seconds_per_sample, 2);  // 8 s for 4
  EXPECT_DOUBLE_EQ(pace_.work_left()->abort_seconds, 6);       // three at work
  now_ += seconds(12);                                         // the next one keeps us waiting
  EXPECT_DOUBLE_EQ(pace_.work_left()->seconds_per_sample, 5);
}

TEST_F(ShardPaceTest, TheCommitTakesWhatTheLastOneTook) {
  pace_.open(1);
  pace_.take(1);
  pace_.begin_commit();
  now_ += seconds(7);
  pace_.close();
  pace_.open(2);
  EXPECT_DOUBLE_EQ(pace_.work_left()->commit_seconds, 7);
  pace_.close();  // given up without a commit
  pace_.open(2);
  EXPECT_DOUBLE_EQ(pace_.work_left()->commit_seconds, 7);
}

TEST_F(ShardPaceTest, TheFirstCommitTakesWhatASlowDiskWould) {
  pace_.open(10);
  EXPECT_DOUBLE_EQ(pace_.work_left()->commit_seconds, 0);
  pace_.take(30'000'000);
  pace_.take(10'000'000);  // 20 MB a sample, 200 MB a shard
  EXPECT_DOUBLE_EQ(pace_.work_left()->commit_seconds, 2);
}

/// Waits until the order is given; a monitor that never gives it fails the test by its time limit.
void wait_for(const StopMonitor& monitor, StopOrder order) {
  while (monitor.order() != order) std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

/// A request and a shard that a test changes while the monitor looks.
struct Scene {
  std::atomic<double> since_s = -1;
  std::atomic<double> seconds_per_sample = 0;
  std::atomic<bool> is_open = true;

  StopMonitor::SinceRequest since() {
    return [this] {
      const double value = since_s;
      return value < 0 ? std::nullopt : std::optional<double>(value);
    };
  }
  StopMonitor::Left left() {
    return [this] {
      return is_open ? std::optional<WorkLeft>({9, seconds_per_sample, 0, 0}) : std::nullopt;
    };
  }
};

TEST(StopMonitor, GivesStricterOrdersAsTimeGoesBy) {
  Scene scene;
  const StopMonitor monitor(scene.since(), kGrace_s, scene.left());
  EXPECT_EQ(monitor.order(), StopOrder::kGoOn);
  scene.since_s = 1;
  wait_for(monitor, StopOrder::kFinishShard);
  scene.seconds_per_sample = 2;  // 1 + 10 x 2 > 20
  wait_for(monitor, StopOrder::kAbort);
}

TEST(StopMonitor, NeverTakesAnAbortBack) {
  Scene scene;
  scene.since_s = 1;
  scene.is_open = false;
  const StopMonitor monitor(scene.since(), kGrace_s, scene.left());
  EXPECT_EQ(monitor.order(), StopOrder::kAbort);  // a request that was there before
  scene.is_open = true;
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(monitor.order(), StopOrder::kAbort);
}

TEST(StopMonitor, WithoutAnybodyWhoAsksGoesOn) {
  Scene scene;
  const StopMonitor monitor({}, kGrace_s, scene.left());
  EXPECT_EQ(monitor.order(), StopOrder::kGoOn);
}

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

TEST(StopSignal, CountsFromTheFirstAndLeavesSignalsAsTheyWere) {
  const StopSignal signal;
  std::raise(SIGUSR1);
  const double first_s = signal.seconds_since_request().value();
  for (int i = 0; i < 3; ++i) {  // schedulers repeat them
    std::raise(SIGTERM);
    std::raise(SIGUSR1);
  }
  EXPECT_GE(signal.seconds_since_request(), first_s);
  std::array<struct sigaction, 3> before{};
  for (std::size_t i = 0; i < kSignals.size(); ++i) before[i] = action_of(kSignals[i]);
  { const StopSignal second; }
  for (std::size_t i = 0; i < kSignals.size(); ++i) {
    EXPECT_EQ(action_of(kSignals[i]).sa_handler, before[i].sa_handler);
  }
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

TEST(StopSignal, TheFirstInterruptIsAnsweredAtOnce) {
  const StopSignal signal("stopping\n");
  const auto said_at = [](int number) {
    ::testing::internal::CaptureStderr();
    std::raise(number);
    return ::testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(said_at(SIGTERM), "");  // nobody looks at a scheduler's terminal
  EXPECT_EQ(said_at(SIGINT), "stopping\n");
}

}  // namespace
}  // namespace eventgan
