#include "pipeline/training/samples/batch_prefetch.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <string>

namespace eventgan {
namespace {

BatchPrefetch::Batch batch_of(std::int64_t step) {
  TrainingSample sample;
  sample.origin = std::to_string(step);
  return {sample};
}

TEST(BatchPrefetch, GivesTheStepsInOrder) {
  BatchPrefetch batches(batch_of, 3, 7, 2);
  for (const std::string step : {"3", "4", "5", "6"}) {
    EXPECT_EQ(batches.next().at(0).origin, step);
  }
  EXPECT_THROW(batches.next(), std::out_of_range);
}

TEST(BatchPrefetch, StartsNoMoreThanItMay) {
  std::atomic<int> started{0};
  {
    BatchPrefetch batches([&](std::int64_t step) { return ++started, batch_of(step); }, 0, 100, 3);
    batches.next();
    EXPECT_LE(started, 4);
  }  // waits for those under way
  EXPECT_EQ(started, 4);
}

TEST(BatchPrefetch, HasNothingForNoSteps) {
  BatchPrefetch batches(batch_of, 5, 5, 2);
  EXPECT_THROW(batches.next(), std::out_of_range);
}

TEST(BatchPrefetch, RethrowsAtTheStepThatFailed) {
  BatchPrefetch batches(
      [](std::int64_t step) {
        if (step == 1) throw std::runtime_error("torn file");
        return batch_of(step);
      },
      0, 3, 3);
  EXPECT_EQ(batches.next().at(0).origin, "0");
  EXPECT_THROW(batches.next(), std::runtime_error);
}

}  // namespace
}  // namespace eventgan
