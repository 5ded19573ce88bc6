#include "pipeline/stopping/stop_order.h"

#include <gtest/gtest.h>

namespace eventgan {
namespace {

constexpr double kGrace_s = 20;

/// 5 samples left of 2 s each, one to spare, a commit of 3 s and an abort of 1 s: 16 s.
constexpr OpenShard kOpen{5, 2, 3, 1};

TEST(StopOrder, WithoutARequestEverythingGoesOn) {
  EXPECT_EQ(stop_order(std::nullopt, kGrace_s, kOpen), StopOrder::kGoOn);
  EXPECT_EQ(stop_order(std::nullopt, 0, std::nullopt), StopOrder::kGoOn);
}

TEST(StopOrder, FinishesAShardThatFitsWithASampleAndAnAbortToSpare) {
  EXPECT_EQ(stop_order(0, kGrace_s, kOpen), StopOrder::kFinishShard);
  EXPECT_EQ(stop_order(4, kGrace_s, kOpen), StopOrder::kFinishShard);
  EXPECT_EQ(stop_order(4.1, kGrace_s, kOpen), StopOrder::kAbort);
}

TEST(StopOrder, EachPartOfTheTimeCounts) {
  for (const OpenShard slower : {OpenShard{6, 2, 3, 1}, OpenShard{5, 2.5, 3, 1},
                                 OpenShard{5, 2, 4, 1}, OpenShard{5, 2, 3, 2}}) {
    EXPECT_EQ(stop_order(4, kGrace_s, slower), StopOrder::kAbort);
  }
}

TEST(StopOrder, WithoutAnOpenShardThereIsNothingToFinish) {
  EXPECT_EQ(stop_order(0, kGrace_s, std::nullopt), StopOrder::kAbort);
}

TEST(StopOrder, WithoutGraceAborts) {
  EXPECT_EQ(stop_order(0.001, 0, OpenShard{0, 0, 0, 0}), StopOrder::kAbort);
}

TEST(StopOrder, AShardThatIsBeingCommittedNeedsOnlyThat) {
  EXPECT_EQ(stop_order(19, kGrace_s, OpenShard{0, 0.1, 0.5, 0.1}), StopOrder::kFinishShard);
}

}  // namespace
}  // namespace eventgan
