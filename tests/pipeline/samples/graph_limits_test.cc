#include "pipeline/samples/graph_limits.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

TEST(GraphLimits, KeepThreadsBusyWithSmallSamples) {
  const PlannedShard small{"s.h5", 0, {20, 30}, {}};
  const GraphLimits limits = graph_limits({&small}, 9, 3);
  EXPECT_EQ(limits.threads, 3);
  EXPECT_EQ(limits.in_flight, 16u);  // four for each thread and four more
  EXPECT_EQ(graph_limits({}, 9, 3).in_flight, 16u);
}

TEST(GraphLimits, HoldNoMoreOfTheLargestThanAGibibyte) {
  const PlannedShard small{"s.h5", 0, {20, 30}, {}};
  // 18 channels of 1024 x 1024 float32, three times: 216 MiB, so four in a gibibyte.
  const PlannedShard large{"l.h5", 0, {1024, 1024}, {}};
  EXPECT_EQ(graph_limits({&small, &large, &small}, 9, 1).in_flight, 4u);
  EXPECT_EQ(graph_limits({&large}, 9, 8).in_flight, 9u);  // never fewer than threads + 1
}

}  // namespace
}  // namespace eventgan
