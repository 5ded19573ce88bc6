#include "stages/files/stale_temporaries.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>

#include "stages/files/temporary_name.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

/// The pid of a process that has just ended.
pid_t dead_pid() {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  ::waitpid(child, nullptr, 0);
  return child;
}

TEST(StaleTemporaries, OnlyThoseOfDeadWritersGo) {
  const testing::TemporaryFolder folder;
  const pid_t dead = dead_pid();
  const std::string other_host = host_name() + "-2";
  const std::string stale = to_string(TemporaryName{"a.h5", host_name(), dead, 0});
  const std::string silent = to_string(TemporaryName{"b.h5", other_host, dead, 0});
  const std::string stale_too = to_string(TemporaryName{"plan.json", host_name(), dead, 17});
  const std::string alive = to_string(TemporaryName{"a.h5", host_name(), ::getpid(), 0});
  const std::string foreign = to_string(TemporaryName{"a.h5", other_host, dead, 0});
  for (const auto& name : {stale, silent, stale_too, alive, foreign, std::string("a.h5")}) {
    testing::write_file(folder / name, "x");
  }
  using std::chrono::hours;
  std::filesystem::last_write_time(folder / silent,
                                   std::filesystem::file_time_type::clock::now() - hours(2));
  EXPECT_THAT(remove_stale_temporaries(folder.path()),
              ::testing::ElementsAre(folder / stale, folder / silent, folder / stale_too));
  EXPECT_THAT(testing::names_in(folder.path()),
              ::testing::UnorderedElementsAre(alive, foreign, "a.h5"));
  EXPECT_TRUE(remove_stale_temporaries(folder.path()).empty());
}

TEST(StaleTemporaries, NamesAFolderThatCannotBeListed) {
  const testing::TemporaryFolder folder;
  try {
    remove_stale_temporaries(folder / "absent");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr((folder / "absent").string()));
  }
}

}  // namespace
}  // namespace eventgan
