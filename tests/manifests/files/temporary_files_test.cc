#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>

#include "manifests/files/atomic_file.h"
#include "manifests/files/unfinished_files.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

/// Its parent: alive as long as this process, and another.
const pid_t kAlivePid = ::getppid();

/// The pid of a process that has just ended.
pid_t dead_pid() {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  ::waitpid(child, nullptr, 0);
  return child;
}

TEST(TemporaryName, ThereAndBackFromAnyHost) {
  // Host names can hold digits alone, and targets dots and digits.
  for (const std::string host : {"node7", "node7_cluster_edu-4026531836", "10_0_0_1", "12"}) {
    for (const std::string target : {"a-train-00000-of-00002.h5", "plan", "a.1.2", ".a"}) {
      const TemporaryName name{target, host, 4242, 3};
      EXPECT_EQ(to_string(name), "." + target + "." + host + ".4242.3.tmp");
      EXPECT_EQ(parse_temporary_name(to_string(name)), name);
    }
  }
}

TEST(TemporaryName, NothingElseIsTakenForOne) {
  for (const std::string_view name :
       {"", ".", ".tmp", "a.h5", "a.h5.node.12.0.tmp", ".a.h5.node.12.0", ".a.h5.node.12.0.tmp~",
        ".a.h5.node.12.tmp", ".a.h5.node.x.0.tmp", ".a.h5.node.12.-1.tmp", ".a.h5.node.0.0.tmp",
        ".a.h5.node.-12.0.tmp", ".node.12.0.tmp", "..node.12.0.tmp", ".a..12.0.tmp",
        ".a.h5.node.99999999999999999999.0.tmp", ".12.0.tmp", "....tmp"}) {
    EXPECT_FALSE(parse_temporary_name(name)) << name;
  }
}

TEST(TemporaryName, AHostIsAWordOfAFileName) {
  EXPECT_EQ(without_dots("node7.cluster.edu"), "node7_cluster_edu");
  EXPECT_EQ(without_dots("../x"), "___x");
  EXPECT_EQ(without_dots("node-7"), "node-7");
  EXPECT_FALSE(host_name().empty());
  const TemporaryName name{"a.h5", host_name(), ::getpid(), 0};
  EXPECT_EQ(parse_temporary_name(to_string(name)), name);
}

class UnfinishedFiles : public ::testing::Test {
 protected:
  /// Makes a temporary as a writer would have, last written `age_s` ago, and looks at it.
  UnfinishedFile file_of(const std::string& host, pid_t pid, double age_s) {
    const TemporaryName name{"a.h5", host, pid, 0};
    const auto path = folder_ / to_string(name);
    testing::write_file(path, "x");
    timespec times[2];
    ::clock_gettime(CLOCK_REALTIME, &times[0]);
    times[0].tv_sec -= static_cast<time_t>(age_s);
    times[1] = times[0];
    ::utimensat(AT_FDCWD, path.c_str(), times, 0);
    for (const UnfinishedFile& file : unfinished_files(folder_.path())) {
      if (file.name == name) return file;
    }
    ADD_FAILURE() << path;
    return {};
  }

  testing::TemporaryFolder folder_;
};

TEST_F(UnfinishedFiles, AreTemporariesAloneInTheOrderOfTheirPaths) {
  const std::string first = to_string(TemporaryName{"a.h5", "node7", 12, 0});
  const std::string second = to_string(TemporaryName{"b.h5", "node6", 11, 3});
  for (const std::string& name :
       {second, std::string("a.h5"), std::string(".hidden"), first, "below/" + first}) {
    testing::write_file(folder_ / name, "x");
  }
  std::filesystem::create_directory(folder_ / to_string(TemporaryName{"c.h5", "node7", 12, 0}));
  const auto files = unfinished_files(folder_.path());
  ASSERT_EQ(files.size(), 2u);
  EXPECT_EQ(files[0].path, folder_ / first);
  EXPECT_EQ(files[1].path, folder_ / second);
  EXPECT_EQ(files[1].name, (TemporaryName{"b.h5", "node6", 11, 3}));
}

TEST_F(UnfinishedFiles, TellWhetherTheirWriterLivesOrTheirAgeAlone) {
  EXPECT_EQ(file_of(host_name(), dead_pid(), 0).writer, WriterLife::kDead);
  EXPECT_EQ(file_of(host_name(), kAlivePid, 0).writer, WriterLife::kAlive);
  EXPECT_EQ(file_of(host_name(), kAlivePid, 1800).writer, WriterLife::kAlive);
  EXPECT_TRUE(is_stale(file_of(host_name(), dead_pid(), 0)));
  EXPECT_FALSE(is_stale(file_of(host_name(), kAlivePid, 3500)));
  const UnfinishedFile young = file_of("node7-1", dead_pid(), 3500);
  EXPECT_EQ(young.writer, WriterLife::kUnknown);
  EXPECT_NEAR(young.silent_s, 3500, 60);
  EXPECT_FALSE(is_stale(young));
  EXPECT_TRUE(is_stale(file_of("node7-1", kAlivePid, 3700)));
}

TEST_F(UnfinishedFiles, OfAZombieAreDead) {
  const pid_t zombie = ::fork();
  ASSERT_NE(zombie, -1);
  if (zombie == 0) ::_exit(0);
  siginfo_t ended{};
  ASSERT_EQ(::waitid(P_PID, static_cast<id_t>(zombie), &ended, WEXITED | WNOWAIT), 0);
  EXPECT_EQ(file_of(host_name(), zombie, 0).writer, WriterLife::kDead);
  ::waitpid(zombie, nullptr, 0);
}

TEST_F(UnfinishedFiles, AnHourOfSilenceTellsThatAnotherHasTheNumberNow) {
  EXPECT_TRUE(is_stale(file_of(host_name(), kAlivePid, 3700)));
}

TEST_F(UnfinishedFiles, OfAnEarlierProcessWithThisOnesNumberAreDead) {
  // A day is more than this process can have lived.
  EXPECT_EQ(file_of(host_name(), ::getpid(), 86400).writer, WriterLife::kDead);
}

TEST_F(UnfinishedFiles, OfThisProcessAreAlive) {
  testing::write_file(temporary_beside(folder_ / "a.h5"), "x");
  const auto files = unfinished_files(folder_.path());
  ASSERT_EQ(files.size(), 1u);
  EXPECT_EQ(files[0].writer, WriterLife::kAlive);
  EXPECT_FALSE(is_stale(files[0]));
}

TEST_F(UnfinishedFiles, OfAClockThatIsAheadAreStaleFromAnHourOn) {
  const UnfinishedFile little = file_of("node7-1", 1, -3500);
  EXPECT_NEAR(little.silent_s, -3500, 60);
  EXPECT_FALSE(is_stale(little));
  EXPECT_TRUE(is_stale(file_of("node7-1", 1, -3700)));
  // Years ahead: it would lie there for years.
  EXPECT_TRUE(is_stale(file_of("node7-1", 1, -1e8)));
  EXPECT_TRUE(is_stale(file_of(host_name(), kAlivePid, -1e8)));
}

TEST_F(UnfinishedFiles, NamesAFolderThatCannotBeListed) {
  EXPECT_THROWS(unfinished_files(folder_ / "absent"), std::runtime_error,
                (folder_ / "absent").string());
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
  const std::string ahead = to_string(TemporaryName{"c.h5", other_host, dead, 0});
  for (const auto& name : {stale, silent, ahead, stale_too, alive, foreign, std::string("a.h5")}) {
    testing::write_file(folder / name, "x");
  }
  using std::chrono::hours;
  std::filesystem::last_write_time(folder / silent,
                                   std::filesystem::file_time_type::clock::now() - hours(2));
  std::filesystem::last_write_time(folder / ahead,
                                   std::filesystem::file_time_type::clock::now() + hours(2));
  EXPECT_THAT(
      remove_stale_temporaries(folder.path()),
      ::testing::ElementsAre(folder / stale, folder / silent, folder / ahead, folder / stale_too));
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
