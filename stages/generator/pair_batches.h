#pragma once

#include <algorithm>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "manifests/values/frames.h"

namespace eventgan {

/// Brings pairs together that several threads want computed at the same time. It has no thread of
/// its own, and nobody waits for a batch to fill: whoever finds no batch under way takes the pairs
/// that wait by then, in the order they came, and computes them; who comes meanwhile waits for the
/// next one. So batches grow with the load, and one thread alone gets its pair at once. Thread
/// safe.
template <class Result>
class PairBatches {
 public:
  using Pairs = std::vector<std::span<const float>>;  ///< [frame, y, x] each, all of one size

  /// Computes 1..most pairs of one size, a result for each; called by one thread at a time.
  using Compute = std::function<std::vector<Result>(const Pairs& pairs, ImageSize size)>;

  /// `most`: pairs of a size in one batch, ≥ 1.
  PairBatches(std::function<int(ImageSize)> most, Compute compute)
      : most_(std::move(most)), compute_(std::move(compute)) {}

  /// The pair's result. What `compute` throws reaches every caller whose pair was in that batch,
  /// and no other; what `most` throws the caller that asked for it.
  Result compute(std::span<const float> frames, ImageSize size) {
    Call own{frames, size, false, {}, {}};
    std::unique_lock lock(mutex_);
    waiting_.push_back(&own);
    while (!own.is_done) {
      if (is_computing_) {
        changed_.wait(lock);
        continue;
      }
      std::vector<Call*> batch;
      try {
        batch = take_batch();
      } catch (...) {
        std::erase(waiting_, &own);
        changed_.notify_all();  // another takes the batch
        throw;
      }
      is_computing_ = true;
      lock.unlock();
      compute_batch(batch);
      lock.lock();
      for (Call* call : batch) call->is_done = true;
      is_computing_ = false;
      changed_.notify_all();
    }
    if (own.failure) std::rethrow_exception(own.failure);
    return std::move(own.result).value();
  }

  /// Pairs that wait for a batch.
  std::size_t waiting() const {
    const std::lock_guard lock(mutex_);
    return waiting_.size();
  }

 private:
  struct Call {
    std::span<const float> frames;
    ImageSize size;
    bool is_done;
    std::optional<Result> result;
    std::exception_ptr failure;
  };

  /// The pair that has waited longest, and those of its size behind it. Changes nothing if it
  /// throws.
  std::vector<Call*> take_batch() {
    const ImageSize size = waiting_.front()->size;
    const auto most = static_cast<std::size_t>(most_(size));
    std::vector<Call*> batch;
    batch.reserve(std::min(most, waiting_.size()));
    std::erase_if(waiting_, [&](Call* call) {
      if (call->size != size || batch.size() == most) return false;
      batch.push_back(call);
      return true;
    });
    return batch;
  }

  void compute_batch(const std::vector<Call*>& batch) const {
    try {
      Pairs pairs;
      for (const Call* call : batch) pairs.push_back(call->frames);
      std::vector<Result> results = compute_(pairs, batch.front()->size);
      for (std::size_t i = 0; i < batch.size(); ++i) batch[i]->result = std::move(results.at(i));
    } catch (...) {
      for (Call* call : batch) call->failure = std::current_exception();
    }
  }

  std::function<int(ImageSize)> most_;
  Compute compute_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Call*> waiting_;
  bool is_computing_ = false;
};

}  // namespace eventgan
