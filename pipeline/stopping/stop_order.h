#pragma once

#include <optional>

namespace eventgan {

/// What a conversion does, by whether it was asked to stop.
enum class StopOrder {
  kGoOn,
  kFinishShard,  ///< finish the shard that is being written, start no other
  kAbort         ///< drop the shard under way and end
};

/// The shard that is being written.
struct OpenShard {
  int samples_left = 0;
  double seconds_per_sample = 0;  ///< wall time, of the run so far
  double commit_seconds = 0;      ///< what the commit will take, by the last one
  double abort_seconds = 0;       ///< what an abort takes: a sample at work is not interrupted
};

/// After a request `since_request_s` seconds ago (none: no request): finishes the open shard if by
/// its rate it will be committed within `grace_s` seconds of the request, with one sample's time
/// and an abort's to spare; else aborts. Aborts if no shard is open. Asked again and again, it
/// turns to kAbort when the shard proves slower than thought, while there is still time for that.
StopOrder stop_order(std::optional<double> since_request_s, double grace_s,
                     const std::optional<OpenShard>& open);

}  // namespace eventgan
