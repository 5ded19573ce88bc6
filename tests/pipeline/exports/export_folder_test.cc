#include "pipeline/exports/export_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "manifests/values/faults.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

TEST(ExportFolder, TakesNamesForTheSameIfTheyDifferInCaseAlone) {
  const testing::TemporaryFolder folder;
  ExportFolder out(folder / "out", "job a\n", /*overwrite=*/false);
  ExportFolder::Step step(out, "shard", "input");
  step.write("a-sample-of-many.tar", "");
  // In small letters libstdc++'s std::hash gives both the same number.
  EXPECT_NO_THROW(step.write("Hkd9g51_o-47trwz.tar", ""));
  EXPECT_THAT([&] { step.write("A-sample-of-many.tar", ""); },
              ThrowsMessage<InputError>(HasSubstr("got A-sample-of-many.tar beside another")));
}

class ExportRuns : public ::testing::Test {
 protected:
  using Files = std::map<std::string, std::set<std::string>>;

  /// A run that writes these files of each step, or finds them done.
  void run(const Files& steps, const std::string& input = "input") const {
    ExportFolder out(path_, "job a\n", /*overwrite=*/false);
    for (const auto& [name, files] : steps) {
      ExportFolder::Step step(out, name, input);
      if (step.is_done()) continue;
      for (const std::string& file : files) step.write(file, input);
      step.finish();
    }
    out.remove_other_steps();
    std::set<std::string> listed, expected;
    out.for_each_file([&](const std::string& file) { listed.insert(file); });
    for (const auto& [name, files] : steps) expected.insert(files.begin(), files.end());
    EXPECT_EQ(listed, expected);
    EXPECT_EQ(found(), expected);
  }

  std::set<std::string> found() const {
    std::set<std::string> files;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(path_)) {
      const auto relative = entry.path().lexically_relative(path_);
      if (entry.is_regular_file() && *relative.begin() != ".export") files.insert(relative);
    }
    return files;
  }

  const testing::TemporaryFolder folder_;
  const std::filesystem::path path_ = folder_ / "out";
};

TEST_F(ExportRuns, KeepWhatIsDone) {
  const Files files{{"a", {"images/a/1.png", "data.yaml"}}, {"b", {"images/b/1.png"}}};
  run(files);
  const auto time = std::filesystem::last_write_time(path_ / "data.yaml");
  run(files);
  EXPECT_EQ(std::filesystem::last_write_time(path_ / "data.yaml"), time);
}

TEST_F(ExportRuns, RemoveOldTemporariesAlsoWhereAllIsDone) {
  const Files files{{"a", {"images/a/1.png", "data.yaml"}}};
  run(files);
  // Of another host: whether its writer lives, only the age tells.
  const auto temporary = path_ / "images/a/.1.png.elsewhere-1.7.0.tmp";
  const auto mine = path_ / "images/a/.mine.tmp";
  for (const auto& path : {temporary, mine}) testing::write_file(path, "part");
  const auto finished = [&] {
    ExportFolder out(path_, "job a\n", /*overwrite=*/false);
    return ExportFolder::Step(out, "a", "input").is_done();
  };
  EXPECT_TRUE(finished());
  EXPECT_TRUE(std::filesystem::exists(temporary)) << "it may be being written";
  using namespace std::chrono_literals;
  for (const auto& path : {temporary, mine}) {
    std::filesystem::last_write_time(path, std::filesystem::file_time_type::clock::now() - 2h);
  }
  EXPECT_TRUE(finished());
  EXPECT_FALSE(std::filesystem::exists(temporary));
  EXPECT_TRUE(std::filesystem::exists(mine)) << "no name of ours";
}

TEST_F(ExportRuns, WriteAgainWhatWasCut) {
  const Files files{{"a", {"labels/a/1.txt", "labels/a/2.txt"}}};
  run(files);
  std::filesystem::resize_file(path_ / "labels/a/2.txt", 2);
  run(files);
  EXPECT_EQ(testing::read_file(path_ / "labels/a/2.txt"), "input");
}

TEST_F(ExportRuns, RemoveWhatAStepNoLongerMakes) {
  run({{"a", {"labels/a/1.txt", "labels/a/2.txt"}}, {"b", {"labels/b/3.txt"}}});
  run({{"a", {"labels/a/2.txt"}}, {"b", {}}}, "another input");
}

TEST_F(ExportRuns, OverwriteNothingWhereAnotherFileLies) {
  const auto overwrite = [&] { ExportFolder(path_, "job a\nother settings\n", true); };
  run({{"a", {"labels/train/1.txt", "data.yaml"}}});
  for (const char* name : {"labels/train.cache", "notes.txt", "mine/1.txt"}) {
    testing::write_file(path_ / name, "mine");
    const auto before = found();
    EXPECT_THAT(overwrite, ThrowsMessage<UsageError>(HasSubstr(
                               "expected an export and nothing else, which --overwrite removes, "
                               "got " +
                               std::string(name).substr(0, 4))));
    EXPECT_EQ(found(), before);
    std::filesystem::remove_all(path_ / name);
    std::filesystem::remove(path_ / "mine");
  }
  EXPECT_NO_THROW(overwrite());
  EXPECT_THAT(found(), IsEmpty());
}

TEST_F(ExportRuns, RemoveTheFilesOfAStepThatIsGoneButThoseThatAnotherMakes) {
  run({{"a", {"images/a/1.png", "data.yaml"}}, {"b", {"images/b/1.png"}}});
  run({{"b", {"images/b/1.png"}}, {"c", {"data.yaml"}}});
  EXPECT_FALSE(std::filesystem::exists(path_ / "images/a"));
}

}  // namespace
}  // namespace eventgan
