#include "manifests/files/atomic_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <thread>
#include <vector>

#include "tests/testing/full_disk.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::names_in;
using testing::read_file;
using testing::TemporaryFolder;

template <class Work>
std::string error_of(Work&& work) {
  try {
    work();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

bool create(const std::filesystem::path& target, const std::string& text) {
  return create_file_atomically(target, [&](const TextSink& sink) { sink(text); });
}

TEST(AtomicFile, WritesAndReplaces) {
  const TemporaryFolder folder;
  write_file_atomically(folder / "a.json", "first");
  EXPECT_EQ(read_file(folder / "a.json"), "first");
  write_file_atomically(folder / "a.json", "");
  EXPECT_EQ(read_file(folder / "a.json"), "");
  EXPECT_THAT(names_in(folder.path()), ElementsAre("a.json"));
}

TEST(AtomicFile, PutsBytesInThePlaceOfWrittenOnes) {
  const TemporaryFolder folder;
  AtomicFile file(folder / "a");
  file.create();
  file.write("abcdef");
  file.overwrite(1, "XY");
  file.write("gh");
  file.publish();
  EXPECT_EQ(read_file(folder / "a"), "aXYdefgh");
}

TEST(RequireNoLink, NamesALinkBelowTheFolder) {
  const TemporaryFolder folder;
  const TemporaryFolder elsewhere;
  testing::write_file(folder / "own/below/a.txt", "x");
  namespace fs = std::filesystem;
  fs::create_symlink(elsewhere.path(), folder / "linked");
  fs::create_symlink(elsewhere / "none", folder / "own/dangling");
  for (const char* own : {"", "own", "own/below/a.txt", "own/none/a.txt", "none"}) {
    EXPECT_NO_THROW(require_no_link(folder.path(), own)) << own;
  }
  EXPECT_NO_THROW(require_no_link(folder / "linked", "a.txt")) << "its user has named it";
  for (const auto& [relative, link] :
       std::vector<std::pair<std::string, std::string>>{{"linked", "linked"},
                                                        {"linked/a.txt", "linked"},
                                                        {"linked/b/a.txt", "linked"},
                                                        {"own/dangling", "own/dangling"}}) {
    EXPECT_THAT(error_of([&] { require_no_link(folder.path(), relative); }),
                HasSubstr("got a symbolic link, in " + (folder / link).string()));
  }
}

TEST(AtomicFile, CreatesOnlyWhatIsNotThere) {
  const TemporaryFolder folder;
  EXPECT_TRUE(create(folder / "plan.json", "mine"));
  EXPECT_FALSE(create(folder / "plan.json", "yours"));
  EXPECT_EQ(read_file(folder / "plan.json"), "mine");
  EXPECT_THAT(names_in(folder.path()), ElementsAre("plan.json"));
}

TEST(AtomicFile, CreatesInPieces) {
  const TemporaryFolder folder;
  const auto write = [](const TextSink& sink) {
    for (const char* piece : {"one ", "", "two"}) sink(piece);
  };
  EXPECT_TRUE(create_file_atomically(folder / "plan.json", write));
  EXPECT_FALSE(create_file_atomically(folder / "plan.json", [](const TextSink&) { FAIL(); }));
  EXPECT_EQ(read_file(folder / "plan.json"), "one two");
}

TEST(AtomicFile, AWriterThatFailsLeavesNothing) {
  const TemporaryFolder folder;
  EXPECT_THROWS(create_file_atomically(folder / "plan.json",
                                       [](const TextSink& sink) {
                                         sink("half");
                                         throw std::logic_error("the other half");
                                       }),
                std::logic_error, "the other half");
  EXPECT_THAT(names_in(folder.path()), ElementsAre());
}

TEST(AtomicFile, OfManyCreatorsOneWins) {
  const TemporaryFolder folder;
  std::atomic<int> winner{-1};
  std::atomic<int> wins{0};
  std::vector<std::jthread> creators;
  for (int i = 0; i < 8; ++i) {
    creators.emplace_back([&, i] {
      if (!create(folder / "plan.json", std::string(10000, char('a' + i)))) return;
      winner = i;
      ++wins;
    });
  }
  creators.clear();
  EXPECT_EQ(wins, 1);
  EXPECT_EQ(read_file(folder / "plan.json"), std::string(10000, char('a' + winner)));
  EXPECT_THAT(names_in(folder.path()), ElementsAre("plan.json"));
}

TEST(AtomicFile, OnAFullDiskTheTargetStaysAsItWas) {
  const TemporaryFolder folder;
  write_file_atomically(folder / "a.json", "old");
  const std::string large(100000, 'x');
  const std::string error =
      testing::error_on_full_disk(1000, [&] { write_file_atomically(folder / "a.json", large); });
  EXPECT_THAT(error, HasSubstr((folder / ".a.json.").string()));
  EXPECT_THAT(error, HasSubstr("File too large"));
  EXPECT_EQ(read_file(folder / "a.json"), "old");
  EXPECT_THAT(names_in(folder.path()), ElementsAre("a.json"));
}

TEST(AtomicFile, ErrorsNameThePath) {
  const TemporaryFolder folder;
  const auto inside = folder / "absent" / "a.json";
  EXPECT_THAT(error_of([&] { write_file_atomically(inside, "x"); }),
              HasSubstr((folder / "absent").string()));
  EXPECT_THAT(error_of([&] { create(inside, "x"); }), HasSubstr((folder / "absent").string()));
  EXPECT_THAT(error_of([&] { sync_to_disk(inside); }), HasSubstr(inside.string()));
  EXPECT_THAT(error_of([&] { publish(folder / "t", folder / "a.json"); }),
              AllOf(HasSubstr((folder / "t").string()), HasSubstr((folder / "a.json").string())));
}

TEST(AtomicFile, TemporaryNamesAreNeverGivenTwice) {
  const TemporaryFolder folder;
  const auto first = temporary_beside(folder / "a.h5");
  EXPECT_NE(first, temporary_beside(folder / "a.h5"));
  EXPECT_EQ(first.parent_path(), folder.path());
  EXPECT_THAT(first.filename().string(),
              AllOf(::testing::StartsWith(".a.h5."), ::testing::EndsWith(".tmp"),
                    HasSubstr("." + std::to_string(::getpid()) + ".")));
}

}  // namespace
}  // namespace eventgan
