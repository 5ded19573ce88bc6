#include "pipeline/conversion/worker_part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <climits>
#include <map>

#include "manifests/faults.h"

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

TEST(ChoosePart, IsEverythingWithoutAWord) {
  EXPECT_EQ(part_in({}), WorkerPart());
  EXPECT_EQ(to_text(part_in({}), 9), "all shards");
}

TEST(ChoosePart, TheFlagWinsOverTheEnvironment) {
  const Variables variables = {{"SHARD_INDEX", "x"}, {"SLURM_ARRAY_TASK_ID", "1"}};
  EXPECT_EQ(part_in(variables, "2/7"), (WorkerPart{2, 7, "--shards"}));
  EXPECT_EQ(part_in(variables, "0/1"), (WorkerPart{0, 1, "--shards"}));
  EXPECT_EQ(part_in(variables, "all"), WorkerPart());
}

TEST(ChoosePart, RefusesAFlagThatIsNoPart) {
  for (const char* flag : {"", "/", "1", "1/", "/2", "2/2", "0/0", "-1/2", "+1/2", "1/-2", "1/2/3",
                           "1 /2", " 1/2", "a/b", "1.0/2", "All", "0x1/2", "0/99999999999"}) {
    EXPECT_THAT([&] { part_in({}, flag); },
                ThrowsMessage<UsageError>(
                    AllOf(HasSubstr("--shards"), HasSubstr("\"" + std::string(flag) + "\""))));
  }
}

TEST(ChoosePart, AnIndexAloneIsAShardOfThePlan) {
  for (const char* name : {"SHARD_INDEX", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"}) {
    const WorkerPart part = part_in({{name, "5"}});
    EXPECT_EQ(part, (WorkerPart{5, 0, name}));
    EXPECT_THAT(shards_of(part, 6), ElementsAre(5));
    EXPECT_EQ(to_text(part, 1024), "shard 5 of 1024 (" + std::string(name) + ")");
  }
}

TEST(ChoosePart, TheSizeOfAnArrayIsNotTheNumberOfParts) {
  const Variables retry = {{"SLURM_ARRAY_TASK_ID", "7"},  {"SLURM_ARRAY_TASK_COUNT", "2"},
                           {"SLURM_ARRAY_TASK_MIN", "3"}, {"SLURM_ARRAY_TASK_MAX", "7"},
                           {"SLURM_PROCID", "0"},         {"SLURM_NTASKS", "1"}};
  EXPECT_EQ(part_in(retry), (WorkerPart{7, 0, "SLURM_ARRAY_TASK_ID"}));
}

TEST(ChoosePart, TheCountIsTheNumberOfParts) {
  for (const char* name : {"SHARD_INDEX", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"}) {
    EXPECT_EQ(part_in({{name, "3"}, {"SHARD_COUNT", "4"}}), (WorkerPart{3, 4, name}));
    // An array counted from 1 by mistake.
    EXPECT_THAT(([&] {
                  part_in({{name, "4"}, {"SHARD_COUNT", "4"}});
                }),
                ThrowsMessage<UsageError>(AllOf(HasSubstr(name), HasSubstr("0..3"))));
  }
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

TEST(ChoosePart, AnMpiRankIsOneOfItsWorld) {
  EXPECT_EQ(part_in({{"OMPI_COMM_WORLD_RANK", "3"}, {"OMPI_COMM_WORLD_SIZE", "4"}}),
            (WorkerPart{3, 4, "OMPI_COMM_WORLD_RANK"}));
  EXPECT_THAT(
      [] {
        part_in({{"OMPI_COMM_WORLD_RANK", "3"}});
      },
      ThrowsMessage<UsageError>(HasSubstr("OMPI_COMM_WORLD_SIZE")));
}

TEST(ChoosePart, ABatchScriptIsNoTaskOfAStep) {
  EXPECT_EQ(part_in({{"SLURM_PROCID", "0"}, {"SLURM_NTASKS", "4"}}), WorkerPart());
  EXPECT_EQ(part_in({{"SLURM_PROCID", "2"}, {"SLURM_STEP_NUM_TASKS", "4"}}),
            (WorkerPart{2, 4, "SLURM_PROCID"}));
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
  EXPECT_THAT(
      [] {
        part_in({{"SHARD_COUNT", "4"}});
      },
      ThrowsMessage<UsageError>(AllOf(HasSubstr("SHARD_INDEX"), HasSubstr("SHARD_COUNT"))));
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

}  // namespace
}  // namespace eventgan
