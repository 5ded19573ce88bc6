#include "pipeline/stopping/stop_monitor.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <utility>

namespace eventgan {
namespace {

constexpr std::chrono::milliseconds kInterval{20};

}  // namespace

StopMonitor::StopMonitor(SinceRequest since_request, double grace_s, Open open)
    : since_request_(std::move(since_request)), grace_s_(grace_s), open_(std::move(open)) {
  if (!since_request_) return;
  look();
  thread_ = std::jthread([this](const std::stop_token& end) {
    std::mutex mutex;
    std::condition_variable_any wake;
    std::unique_lock lock(mutex);
    while (order_ != StopOrder::kAbort && !end.stop_requested()) {
      wake.wait_for(lock, end, kInterval, [] { return false; });
      look();
    }
  });
}

void StopMonitor::look() {
  order_ = std::max(order_.load(), stop_order(since_request_(), grace_s_, open_()));
}

}  // namespace eventgan
