#include "pipeline/conversion/shard_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <stdexcept>

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class ShardQueueTest : public ::testing::Test {
 protected:
  ShardQueueTest() {
    for (const char* name : {"a", "b", "c"}) plan_.push_back({name, 0, {1, 1}, {}});
  }

  ShardQueue queue() {
    std::vector<const PlannedShard*> shards;
    for (const PlannedShard& shard : plan_) shards.push_back(&shard);
    return ShardQueue(shards, [this](const PlannedShard& shard) { return activity_[shard.name]; });
  }

  static std::string name_of(const PlannedShard* shard) { return shard ? shard->name : "none"; }

  static std::vector<std::string> done(const ShardQueue& queue) {
    std::vector<std::string> names;
    for (const PlannedShard* shard : queue.done_by_others()) names.push_back(shard->name);
    return names;
  }

  std::vector<PlannedShard> plan_;
  std::map<std::string, ShardActivity> activity_;  // kFree unless set
};

TEST_F(ShardQueueTest, AloneItIsThePlan) {
  ShardQueue all = queue();
  for (const char* expected : {"a", "b", "c", "none", "none"}) {
    EXPECT_EQ(name_of(all.next()), expected);
  }
  EXPECT_THAT(done(all), IsEmpty());
}

TEST_F(ShardQueueTest, NothingToDoIsTheEnd) {
  ShardQueue empty({}, nullptr);
  EXPECT_EQ(empty.next(), nullptr);
}

TEST_F(ShardQueueTest, SkipsWhatAnotherHasFinishedMeanwhile) {
  ShardQueue all = queue();
  EXPECT_EQ(name_of(all.next()), "a");
  activity_["b"] = ShardActivity::kDone;
  EXPECT_EQ(name_of(all.next()), "c");
  EXPECT_EQ(name_of(all.next()), "none");
  EXPECT_THAT(done(all), ElementsAre("b"));
}

TEST_F(ShardQueueTest, MakesWhatAnotherIsWritingAtTheEndAllTheSame) {
  activity_["a"] = activity_["b"] = ShardActivity::kBusy;
  ShardQueue all = queue();
  for (const char* expected : {"c", "a", "b", "none", "none"}) {
    EXPECT_EQ(name_of(all.next()), expected);
  }
}

TEST_F(ShardQueueTest, LooksAgainAtWhatItPutOff) {
  activity_["a"] = activity_["b"] = ShardActivity::kBusy;
  ShardQueue all = queue();
  EXPECT_EQ(name_of(all.next()), "c");
  activity_["a"] = ShardActivity::kDone;
  EXPECT_EQ(name_of(all.next()), "b");
  EXPECT_EQ(name_of(all.next()), "none");
  EXPECT_THAT(done(all), ElementsAre("a"));
}

TEST_F(ShardQueueTest, TakesFirstWhatAnotherHasGivenUp) {
  for (const PlannedShard& shard : plan_) activity_[shard.name] = ShardActivity::kBusy;
  ShardQueue all = queue();
  activity_["b"] = ShardActivity::kFree;
  EXPECT_EQ(name_of(all.next()), "b");
  for (const char* expected : {"a", "c", "none"}) EXPECT_EQ(name_of(all.next()), expected);
}

TEST_F(ShardQueueTest, AStopEndsTheLooks) {
  for (const PlannedShard& shard : plan_) activity_[shard.name] = ShardActivity::kDone;
  ShardQueue all = queue();
  int asked = 0;
  EXPECT_EQ(all.next([&] { return ++asked == 3; }), nullptr);
  EXPECT_THAT(done(all), ElementsAre("a", "b"));
  for (const PlannedShard& shard : plan_) activity_[shard.name] = ShardActivity::kBusy;
  ShardQueue busy = queue();
  asked = 0;
  EXPECT_EQ(busy.next([&] { return ++asked == 5; }), nullptr);
}

TEST_F(ShardQueueTest, AFailedLookLosesNoShard) {
  bool fails = true;
  ShardQueue one({&plan_[0]}, [&](const PlannedShard&) {
    if (fails) throw std::runtime_error("cannot list");
    return ShardActivity::kFree;
  });
  EXPECT_THROW(one.next(), std::runtime_error);
  fails = false;
  EXPECT_EQ(one.next(), &plan_[0]);
}

}  // namespace
}  // namespace eventgan
