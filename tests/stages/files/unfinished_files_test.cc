#include "stages/files/unfinished_files.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "stages/files/atomic_file.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

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

TEST_F(UnfinishedFiles, OfThisHostTellWhetherTheirWriterLives) {
  EXPECT_EQ(file_of(host_name(), dead_pid(), 0).writer, WriterLife::kDead);
  EXPECT_EQ(file_of(host_name(), kAlivePid, 0).writer, WriterLife::kAlive);
  EXPECT_EQ(file_of(host_name(), kAlivePid, 1800).writer, WriterLife::kAlive);
  EXPECT_TRUE(is_stale(file_of(host_name(), dead_pid(), 0)));
  EXPECT_FALSE(is_stale(file_of(host_name(), kAlivePid, 3500)));
}

TEST_F(UnfinishedFiles, OfAnotherHostTellTheirAgeAlone) {
  const UnfinishedFile young = file_of("node7-1", dead_pid(), 3500);
  EXPECT_EQ(young.writer, WriterLife::kUnknown);
  EXPECT_NEAR(young.silent_s, 3500, 60);
  EXPECT_FALSE(is_stale(young));
  EXPECT_TRUE(is_stale(file_of("node7-1", kAlivePid, 3700)));
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

TEST_F(UnfinishedFiles, AreNeverOlderThanNow) {
  const UnfinishedFile file = file_of("node7-1", 1, -7200);  // of a clock that is ahead
  EXPECT_EQ(file.silent_s, 0);
  EXPECT_FALSE(is_stale(file));
}

TEST_F(UnfinishedFiles, NamesAFolderThatCannotBeListed) {
  EXPECT_THAT([&] { unfinished_files(folder_ / "absent"); },
              ::testing::ThrowsMessage<std::runtime_error>(
                  ::testing::HasSubstr((folder_ / "absent").string())));
}

}  // namespace
}  // namespace eventgan
