#include "pipeline/conversion/worker_part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <climits>
#include <map>
#include <stdexcept>

#include "manifests/documents/commit_record.h"
#include "manifests/files/unfinished_files.h"
#include "manifests/values/faults.h"
#include "pipeline/conversion/shard_queue.h"
#include "pipeline/folder/output_folder.h"
#include "tests/pipeline/conversion/small_conversion.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

using Variables = std::map<std::string, std::string>;

WorkerPart part_in(const Variables& variables,
                   const std::optional<std::string>& flag = std::nullopt) {
  return choose_part(flag, [&](const char* name) {
    const auto found = variables.find(name);
    return found == variables.end() ? nullptr : found->second.c_str();
  });
}

/// The shards of a part, ascending, in a plan of so many.
std::vector<int> shards_of(const WorkerPart& part, int shard_count) {
  std::vector<int> shards;
  for (int shard = 0; shard < shard_count; ++shard) {
    if (part.has(shard)) shards.push_back(shard);
  }
  return shards;
}

TEST(ChoosePart, IsEverythingWithoutAWordAndTheFlagWins) {
  EXPECT_EQ(part_in({}), WorkerPart());
  EXPECT_EQ(to_text(part_in({}), 9), "all shards");
  const Variables variables = {{"SHARD_INDEX", "x"}, {"SLURM_ARRAY_TASK_ID", "1"}};
  EXPECT_EQ(part_in(variables, "2/7"), (WorkerPart{2, 7, "--shards"}));
  EXPECT_EQ(part_in(variables, "0/1"), (WorkerPart{0, 1, "--shards"}));
  EXPECT_EQ(part_in(variables, "all"), WorkerPart());
}

TEST(ChoosePart, RefusesAFlagThatIsNoPart) {
  for (const char* flag : {"", "/", "1", "1/", "/2", "2/2", "0/0", "-1/2", "+1/2", "1/-2", "1/2/3",
                           "1 /2", " 1/2", "a/b", "1.0/2", "All", "0x1/2", "0/99999999999"}) {
    EXPECT_THROWS(part_in({}, flag), UsageError, "--shards", "\"" + std::string(flag) + "\"");
  }
}

TEST(ChoosePart, AnIndexAloneIsAShardAndWithACountOneOfSoManyParts) {
  for (const char* name : {"SHARD_INDEX", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"}) {
    const WorkerPart part = part_in({{name, "5"}});
    EXPECT_EQ(part, (WorkerPart{5, 0, name}));
    EXPECT_THAT(shards_of(part, 6), ElementsAre(5));
    EXPECT_EQ(to_text(part, 1024), "shard 5 of 1024 (" + std::string(name) + ")");
  }
  for (const char* name : {"SHARD_INDEX", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"}) {
    EXPECT_EQ(part_in({{name, "3"}, {"SHARD_COUNT", "4"}}), (WorkerPart{3, 4, name}));
    // An array counted from 1 by mistake.
    EXPECT_THAT(([&] {
                  part_in({{name, "4"}, {"SHARD_COUNT", "4"}});
                }),
                ThrowsMessage<UsageError>(AllOf(HasSubstr(name), HasSubstr("0..3"))));
  }
}

TEST(ChoosePart, KnowsMpiRanksAndStepsOfSlurm) {
  const Variables retry = {{"SLURM_ARRAY_TASK_ID", "7"},  {"SLURM_ARRAY_TASK_COUNT", "2"},
                           {"SLURM_ARRAY_TASK_MIN", "3"}, {"SLURM_ARRAY_TASK_MAX", "7"},
                           {"SLURM_PROCID", "0"},         {"SLURM_NTASKS", "1"}};
  EXPECT_EQ(part_in(retry), (WorkerPart{7, 0, "SLURM_ARRAY_TASK_ID"}));
  EXPECT_EQ(part_in({{"OMPI_COMM_WORLD_RANK", "3"}, {"OMPI_COMM_WORLD_SIZE", "4"}}),
            (WorkerPart{3, 4, "OMPI_COMM_WORLD_RANK"}));
  EXPECT_THROWS(part_in({{"OMPI_COMM_WORLD_RANK", "3"}}), UsageError, "OMPI_COMM_WORLD_SIZE");
  EXPECT_EQ(part_in({{"SLURM_PROCID", "0"}, {"SLURM_NTASKS", "4"}}), WorkerPart());
  EXPECT_EQ(part_in({{"SLURM_PROCID", "2"}, {"SLURM_STEP_NUM_TASKS", "4"}}),
            (WorkerPart{2, 4, "SLURM_PROCID"}));
}

TEST(ChoosePart, OwnVariablesWinOverThoseOfClusters) {
  Variables variables = {{"SHARD_INDEX", "1"},          {"SLURM_ARRAY_TASK_ID", "2"},
                         {"JOB_COMPLETION_INDEX", "3"}, {"OMPI_COMM_WORLD_RANK", "4"},
                         {"OMPI_COMM_WORLD_SIZE", "9"}, {"SLURM_PROCID", "5"},
                         {"SLURM_STEP_NUM_TASKS", "9"}};
  for (const char* name : {"SHARD_INDEX", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX",
                           "OMPI_COMM_WORLD_RANK", "SLURM_PROCID"}) {
    EXPECT_EQ(part_in(variables).origin, name);
    variables.erase(name);
  }
  EXPECT_EQ(part_in(variables), WorkerPart());
}

TEST(ChoosePart, NamesTheVariableThatIsNoNumber) {
  for (const char* name : {"SHARD_INDEX", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"}) {
    for (const char* value : {"", "x", "-1", "1 ", "1,2", "99999999999"}) {
      EXPECT_THAT(([&] {
                    part_in({{name, value}});
                  }),
                  ThrowsMessage<UsageError>(
                      AllOf(HasSubstr(name), HasSubstr("\"" + std::string(value) + "\""))));
    }
  }
  for (const char* count : {"", "0", "-1", "x"}) {
    EXPECT_THAT(([&] {
                  part_in({{"SHARD_INDEX", "0"}, {"SHARD_COUNT", count}});
                }),
                ThrowsMessage<UsageError>(HasSubstr("SHARD_COUNT")));
  }
}

TEST(ChoosePart, ACountWithoutAnIndexIsAMistake) {
  EXPECT_THROWS(part_in({{"SHARD_COUNT", "4"}}), UsageError, "SHARD_INDEX", "SHARD_COUNT");
}

TEST(ShardsOf, EveryShardIsInOnePart) {
  for (int count : {1, 2, 3, 4, 7, 20}) {
    std::vector<int> owners(10, 0);
    for (int index = 0; index < count; ++index) {
      for (const int shard : shards_of({index, count, "--shards"}, 10)) {
        EXPECT_EQ(shard % count, index);
        ++owners.at(static_cast<std::size_t>(shard));
      }
    }
    EXPECT_THAT(owners, ::testing::Each(1)) << count;
  }
  EXPECT_THAT(shards_of({}, 3), ElementsAre(0, 1, 2));
  EXPECT_THAT(shards_of({1, 3, "--shards"}, 8), ElementsAre(1, 4, 7));
}

TEST(ShardsOf, APartBeyondThePlanIsEmpty) {
  EXPECT_THAT(shards_of({5, 7, "--shards"}, 5), IsEmpty());
  EXPECT_THAT(shards_of({5, 0, "SHARD_INDEX"}, 5), IsEmpty());
  EXPECT_THAT(shards_of({INT_MAX, 0, "SHARD_INDEX"}, 5), IsEmpty());
  EXPECT_THAT(shards_of({0, 0, "SHARD_INDEX"}, 0), IsEmpty());
  EXPECT_THAT(shards_of({}, 0), IsEmpty());
  EXPECT_THAT(shards_of({1, INT_MAX, "--shards"}, 3), ElementsAre(1));
}

TEST(WorkerPart, SaysWhatItIs) {
  EXPECT_EQ(to_text({3, 7, "--shards"}, 100), "part 3 of 7 (--shards)");
}

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

TEST_F(ShardQueueTest, AloneItIsThePlanAndNothingIsTheEnd) {
  ShardQueue all = queue();
  for (const char* expected : {"a", "b", "c", "none", "none"}) {
    EXPECT_EQ(name_of(all.next()), expected);
  }
  EXPECT_THAT(done(all), IsEmpty());
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
  EXPECT_THROWS(one.next(), std::runtime_error, "cannot list");
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

TEST_F(SharedFolderTest, AFreeShardIsClaimedUntilItIsReleased) {
  SharedFolder shared(folder_.path(), "hash", {});
  EXPECT_EQ(shared.look_at(shard_), ShardActivity::kFree);
  const auto names = testing::names_in(folder_.path());
  ASSERT_EQ(names.size(), 1u);
  EXPECT_EQ(parse_temporary_name(names[0])->target, shard_.name);
  shared.release(shard_);
  EXPECT_THAT(testing::names_in(folder_.path()), IsEmpty());
  shared.release(shard_);  // once more, or without a claim, is nothing
}

TEST_F(SharedFolderTest, TheClaimTellsHowManySamplesAreWritten) {
  SharedFolder shared(folder_.path(), "hash", {}, std::chrono::seconds(0));
  shared.tell(shard_, 1);  // nothing, without a claim
  ASSERT_EQ(shared.look_at(shard_), ShardActivity::kFree);
  const auto claim = folder_ / testing::names_in(folder_.path()).at(0);
  EXPECT_EQ(testing::read_file(claim), "");
  shared.tell(shard_, 12);
  EXPECT_EQ(testing::read_file(claim), "12");
  std::filesystem::remove(claim);  // as others do where its worker seems dead
  EXPECT_NO_THROW(SharedFolder(folder_.path(), "hash", {}).tell(shard_, 13));
  EXPECT_THAT(testing::names_in(folder_.path()), IsEmpty());
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
  write_temporary(commit_record_name(shard_.name), "elsewhere-1", 1);
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
  EXPECT_THROWS(shared.look_at(shard_), std::runtime_error, (folder_ / "gone").string());
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
