#include "pipeline/conversion/shard_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <map>
#include <stdexcept>

#include "pipeline/folder/output_folder.h"
#include "stages/files/temporary_name.h"
#include "tests/pipeline/conversion/small_conversion.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
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

/// A shard that nobody has begun, in an empty folder.
class SharedFolderTest : public ::testing::Test {
 protected:
  SharedFolderTest() { shard_.samples.resize(3); }

  /// A temporary file of another worker, written this moment.
  std::filesystem::path write_temporary(const std::string& target, const std::string& host,
                                        pid_t pid) const {
    const auto file = folder_ / to_string(TemporaryName{target, host, pid, 0});
    testing::write_file(file, "half");
    return file;
  }

  ShardActivity look() const { return SharedFolder(folder_.path(), "hash", {}).look_at(shard_); }

  testing::TemporaryFolder folder_;
  PlannedShard shard_{"job-train-00000-of-00001.h5", 0, {1, 1}, {}};
};

TEST_F(SharedFolderTest, AFreeShardIsClaimedUntilItIsOpened) {
  SharedFolder shared(folder_.path(), "hash", {});
  EXPECT_EQ(shared.look_at(shard_), ShardActivity::kFree);
  const auto names = testing::names_in(folder_.path());
  ASSERT_EQ(names.size(), 1u);
  EXPECT_EQ(parse_temporary_name(names[0])->target, shard_.name);
  shared.opened(shard_);
  EXPECT_THAT(testing::names_in(folder_.path()), IsEmpty());
  shared.opened(shard_);  // once more, or without a claim, is nothing
}

TEST_F(SharedFolderTest, ClaimsEndWithTheWorker) {
  EXPECT_EQ(look(), ShardActivity::kFree);
  EXPECT_THAT(testing::names_in(folder_.path()), IsEmpty());
}

TEST_F(SharedFolderTest, AShardThatALivingWorkerWritesIsBusy) {
  const auto own = write_temporary(shard_.name, host_name(), ::getpid());
  EXPECT_EQ(look(), ShardActivity::kFree);  // that is us
  const auto parent = write_temporary(shard_.name, host_name(), ::getppid());
  EXPECT_EQ(look(), ShardActivity::kBusy);
  std::filesystem::remove(parent);
  const auto elsewhere = write_temporary(shard_.name, "elsewhere-1", 1);
  EXPECT_EQ(look(), ShardActivity::kBusy);
  std::filesystem::remove(elsewhere);
  write_temporary(marker_name(shard_.name), "elsewhere-1", 1);
  EXPECT_EQ(look(), ShardActivity::kBusy);  // about to be committed
}

TEST_F(SharedFolderTest, OtherShardsAndDeadWorkersKeepNobody) {
  write_temporary("job-train-00000-of-00002.h5", "elsewhere-1", 1);
  const auto silent = write_temporary(shard_.name, "elsewhere-1", 1);
  std::filesystem::last_write_time(
      silent, std::filesystem::file_time_type::clock::now() - std::chrono::hours(2));
  EXPECT_EQ(look(), ShardActivity::kFree);
}

TEST_F(SharedFolderTest, AFolderThatIsGoneIsNamed) {
  SharedFolder shared(folder_ / "gone", "hash", {});
  EXPECT_THAT([&] { shared.look_at(shard_); },
              ::testing::ThrowsMessage<std::runtime_error>(HasSubstr((folder_ / "gone").string())));
}

using SharedFolderOfARun = testing::SmallConversion;

TEST_F(SharedFolderOfARun, ACommittedShardIsDone) {
  run();
  const FrozenPlan frozen = read_frozen_plan(folder_ / "out");
  const PlannedShard& shard = frozen.plan.shards[1];
  SharedFolder trusting(folder_ / "out", frozen.hash, {});
  SharedFolder distrusting(folder_ / "out", frozen.hash, {{shard.name, ""}});
  EXPECT_EQ(trusting.look_at(shard), ShardActivity::kDone);
  EXPECT_EQ(distrusting.look_at(shard), ShardActivity::kDone);  // hashed, and whole
  std::string bytes = testing::read_file(out(shard.name));
  bytes.back() ^= 1;
  testing::write_file(out(shard.name), bytes);
  EXPECT_EQ(trusting.look_at(shard), ShardActivity::kDone);
  EXPECT_EQ(distrusting.look_at(shard), ShardActivity::kFree);
  EXPECT_EQ(SharedFolder(folder_ / "out", "other", {}).look_at(shard), ShardActivity::kFree);
}

}  // namespace
}  // namespace eventgan
