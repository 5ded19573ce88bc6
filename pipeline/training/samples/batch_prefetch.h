#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <vector>

#include "stages/training/training_sample.h"

namespace eventgan {

/// Prepares the batches of the steps to come in the background, a few ahead and no more. Since a
/// batch is a function of its step, what it gives does not depend on timing. For one thread; `make`
/// is called from several at once.
class BatchPrefetch {
 public:
  using Batch = std::vector<TrainingSample>;

  /// Batches of the steps first..end-1, at most `ahead` ≥ 1 of them in preparation or waiting.
  BatchPrefetch(std::function<Batch(std::int64_t)> make, std::int64_t first, std::int64_t end,
                int ahead);

  /// The next step's batch; rethrows what `make` threw for it. Throws std::out_of_range after the
  /// last one.
  Batch next();

 private:
  void fill();

  std::function<Batch(std::int64_t)> make_;
  std::int64_t started_;
  std::int64_t end_;
  std::size_t ahead_;
  std::deque<std::future<Batch>> waiting_;  // destroyed first, and so waits for the calls of make_
};

}  // namespace eventgan
