#include "pipeline/conversion/shared_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "pipeline/folder/output_folder.h"
#include "stages/files/temporary_name.h"
#include "tests/pipeline/conversion/small_conversion.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

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
