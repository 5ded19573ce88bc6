#include "pipeline/training/samples/batch_prefetch.h"

#include <stdexcept>
#include <utility>

namespace eventgan {

BatchPrefetch::BatchPrefetch(std::function<Batch(std::int64_t)> make, std::int64_t first,
                             std::int64_t end, int ahead)
    : make_(std::move(make)), started_(first), end_(end), ahead_(static_cast<std::size_t>(ahead)) {
  fill();
}

BatchPrefetch::Batch BatchPrefetch::next() {
  if (waiting_.empty()) throw std::out_of_range("expected a step before the last, got none left");
  std::future<Batch> oldest = std::move(waiting_.front());
  waiting_.pop_front();
  Batch batch = oldest.get();
  fill();
  return batch;
}

void BatchPrefetch::fill() {
  while (waiting_.size() < ahead_ && started_ < end_) {
    waiting_.push_back(std::async(std::launch::async, make_, started_++));
  }
}

}  // namespace eventgan
