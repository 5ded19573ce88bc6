#include "pipeline/stopping/stop_order.h"

namespace eventgan {

StopOrder stop_order(std::optional<double> since_request_s, double grace_s,
                     const std::optional<OpenShard>& open) {
  if (!since_request_s) return StopOrder::kGoOn;
  if (!open) return StopOrder::kAbort;
  const double end_s =
      *since_request_s + (open->samples_left + 1) * open->seconds_per_sample + open->commit_seconds;
  return end_s + open->abort_seconds <= grace_s ? StopOrder::kFinishShard : StopOrder::kAbort;
}

}  // namespace eventgan
