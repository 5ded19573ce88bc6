#include "pipeline/stopping/stop_monitor.h"

#include <gtest/gtest.h>

#include <chrono>

namespace eventgan {
namespace {

constexpr double kGrace_s = 20;

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
  StopMonitor::Open open() {
    return [this] {
      return is_open ? std::optional<OpenShard>({9, seconds_per_sample, 0, 0}) : std::nullopt;
    };
  }
};

TEST(StopMonitor, GivesStricterOrdersAsTimeGoesBy) {
  Scene scene;
  const StopMonitor monitor(scene.since(), kGrace_s, scene.open());
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
  const StopMonitor monitor(scene.since(), kGrace_s, scene.open());
  EXPECT_EQ(monitor.order(), StopOrder::kAbort);  // a request that was there before
  scene.is_open = true;
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(monitor.order(), StopOrder::kAbort);
}

TEST(StopMonitor, WithoutAnybodyWhoAsksGoesOn) {
  Scene scene;
  const StopMonitor monitor({}, kGrace_s, scene.open());
  EXPECT_EQ(monitor.order(), StopOrder::kGoOn);
}

}  // namespace
}  // namespace eventgan
