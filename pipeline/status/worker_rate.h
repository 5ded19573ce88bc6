#pragma once

#include <optional>
#include <vector>

namespace eventgan {

/// What a marker tells about the speed of the worker that committed it.
struct CommitRecord {
  double time_s = 0;  ///< when, from any fixed point in time
  int samples = 0;
  double wall_seconds = 0;  ///< that the worker spent on the shard; 0 if unknown
};

/// Samples a second of one worker, as of late: the median over the last commits, a few for each of
/// `writers` workers, so that neither one that was paused for a night nor a slow beginning counts.
/// None if no record knows its time.
std::optional<double> worker_rate(std::vector<CommitRecord> records, int writers);

}  // namespace eventgan
