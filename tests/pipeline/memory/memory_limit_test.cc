#include "pipeline/memory/memory_limit.h"

#include <gtest/gtest.h>

#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

TEST(MemoryLimit, IsAtMostTheMachines) {
  EXPECT_GT(memory_limit_bytes(), std::size_t{1} << 20);
  EXPECT_LT(memory_limit_bytes(), std::size_t{1} << 50);
}

TEST(GroupMemoryLimit, IsTheLeastOfTheGroupAndThoseAbove) {
  const testing::TemporaryFolder root;
  std::filesystem::create_directories(root / "jobs/one/step");
  testing::write_file(root / "jobs/memory.max", "3000\n");
  testing::write_file(root / "jobs/one/memory.max", "5000\n");
  testing::write_file(root / "jobs/one/step/memory.max", "max\n");
  const std::filesystem::path folder = root / "";
  EXPECT_EQ(group_memory_limit_bytes(folder, "jobs/one/step", 9000), 3000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "jobs/one/step", 2000), 2000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "jobs", 9000), 3000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "/jobs/", 9000), 3000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "", 9000), 9000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "elsewhere", 9000), 9000u);
  EXPECT_EQ(group_memory_limit_bytes(folder, "../outside", 9000), 9000u);
}

}  // namespace
}  // namespace eventgan
