#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <thread>

#include "pipeline/stopping/stop_order.h"

namespace eventgan {

/// Turns a request to stop into orders while it lives: asks some fifty times a second, also when
/// nothing else moves. Orders only get stricter.
class StopMonitor {
 public:
  using SinceRequest = std::function<std::optional<double>()>;  ///< StopSignal's, say
  using Open = std::function<std::optional<OpenShard>()>;       ///< ShardPace's, say

  /// Both functions are called from a thread of its own; they must be thread safe and not throw.
  /// Without `since_request` the order is always kGoOn. The first order stands on return.
  StopMonitor(SinceRequest since_request, double grace_s, Open open);

  /// Thread safe, and cheap enough to ask for every sample.
  StopOrder order() const { return order_.load(); }

 private:
  void look();

  SinceRequest since_request_;
  double grace_s_;
  Open open_;
  std::atomic<StopOrder> order_{StopOrder::kGoOn};
  std::jthread thread_;  // last, so that it ends first
};

}  // namespace eventgan
