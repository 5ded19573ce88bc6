#include "pipeline/folder/shard_guard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <csignal>
#include <functional>
#include <stdexcept>
#include <vector>

#include "manifests/documents/commit_record.h"
#include "manifests/files/sha256.h"
#include "manifests/values/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class ReadGuarded : public ::testing::Test {
 protected:
  ReadGuarded() { testing::write_file(shard_, "bytes"); }

  void write_commit_record_of(const std::string& bytes) const {
    CommitRecord record;
    record.shard = shard_.filename().string();
    record.plan_hash = std::string(64, 'a');
    record.sha256 = sha256_hex(bytes);
    record.size_bytes = static_cast<std::int64_t>(bytes.size());
    testing::write_file(folder_ / "job-train-00000-of-00001.json", to_json(record));
  }

  /// Whether `read` runs in this very process.
  bool is_trusted() const {
    bool here = false;
    EXPECT_EQ(read_guarded(shard_, [&] { return here = true, 7; }), 7);
    return here;
  }

  void expect_damaged(const std::function<int()>& read, const std::string& why) const {
    EXPECT_THROWS(read_guarded(shard_, read), std::runtime_error, "damaged", why, shard_.string());
  }

  testing::TemporaryFolder folder_;
  const std::filesystem::path shard_ = folder_ / "job-train-00000-of-00001.h5";
};

TEST_F(ReadGuarded, WithItsCommitRecordBesideItTheBytesAreCompared) {
  write_commit_record_of("bytes");
  EXPECT_TRUE(is_trusted());
  write_commit_record_of("bytez");
  expect_damaged([]() -> int { throw std::logic_error("was read"); }, "SHA-256");
  write_commit_record_of("byte");
  expect_damaged([]() -> int { throw std::logic_error("was read"); },
                 "size in bytes in its commit record 4");
}

TEST_F(ReadGuarded, WithoutACommitRecordOfItsOwnItIsReadApart) {
  EXPECT_FALSE(is_trusted());
  testing::write_file(folder_ / "job-train-00000-of-00001.json", "{");
  EXPECT_FALSE(is_trusted());
  EXPECT_EQ(read_guarded(shard_, []() -> int { throw InputError("gone"); }), 66);
}

TEST_F(ReadGuarded, ACrashIsDamage) {
  expect_damaged([] { return ::raise(SIGSEGV); }, "Segmentation fault");
  expect_damaged([] { return ::raise(SIGABRT); }, "Aborted");
}

TEST_F(ReadGuarded, WhatEndsTheChildFromOutsideIsNoDamage) {
  for (const int signal : {SIGKILL, SIGXCPU}) {
    EXPECT_THROWS(read_apart(folder_.path(), [&] { return ::raise(signal); }), std::runtime_error,
                  AllOf(HasSubstr("stopped by a signal from outside"),
                        HasSubstr(folder_.path().string()), Not(HasSubstr("damaged"))));
  }
}

TEST_F(ReadGuarded, AChildWhoseEndNobodyTellsIsNoSuccess) {
  std::signal(SIGCHLD, SIG_IGN);
  EXPECT_THROWS(read_apart(folder_.path(), [] { return 1; }), std::runtime_error,
                "cannot wait for a process to read " + folder_.path().string());
  std::signal(SIGCHLD, SIG_DFL);
}

TEST_F(ReadGuarded, ALoopWithoutEndIsDamage) {
  expect_damaged(
      [] {
        const volatile bool for_ever = true;
        while (for_ever) {
        }
        return 0;
      },
      "10 s");
}

TEST_F(ReadGuarded, MoreMemoryThanThereIsIsDamage) {
  EXPECT_EQ(read_guarded(shard_,
                         [] {
                           const std::vector<char> most(std::size_t{1} << 46);
                           return static_cast<int>(most.back());
                         }),
            1);
}

TEST_F(ReadGuarded, PartsOfManyShardsAreReadApartAlways) {
  write_commit_record_of("bytes");
  bool here = false;
  EXPECT_EQ(read_apart(folder_.path(), [&] { return here = true, 7; }), 7);
  EXPECT_FALSE(here);
  EXPECT_THROWS(read_apart(folder_.path(), [] { return ::raise(SIGSEGV); }), std::runtime_error,
                folder_.path().string());
}

TEST_F(ReadGuarded, OnlyARegularFileIsOpened) {
  const std::filesystem::path pipe = folder_ / "pipe.h5";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_THROWS(read_guarded(pipe, [] { return 0; }), std::runtime_error, pipe.string());
  bool here = false;  // what reads says that there is none
  read_guarded(folder_ / "none.h5", [&] { return here = true, 0; });
  EXPECT_TRUE(here);
}

}  // namespace
}  // namespace eventgan
