#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/folder/verify_folder.h"
#include "tests/testing/temporary_folder.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

TEST(StrayFiles, AreThoseThatLookLikeThePlansAndAreNot) {
  const testing::TemporaryFolder folder;
  PlanOutline plan;
  plan.shards = {{"job-train-00000-of-00001.h5", 0, {2, 2}, 1}};
  for (const char* name :
       {"job-train-00000-of-00001.h5", "job-train-00000-of-00001.json", "plan.json", "run.json",
        "amendments.json", "dataset.json", "dataset.h5", "notes.txt", "pictures/deeper.h5",
        ".job-train-00000-of-00001.h5.host.1.1.tmp"}) {
    testing::write_file(folder / name, "");
  }
  testing::write_file(folder / "mine.json", R"({ "format": "eventgan-manifest", // a job
                                                 "version": 1 })");
  EXPECT_THAT(stray_files(folder.path(), plan), IsEmpty());

  testing::write_file(folder / "old.h5", "");
  testing::write_file(folder / "job-train-00000-of-00009.json", R"({"format": "eventgan-marker"})");
  std::filesystem::create_directory(folder / "folder.json");
  const auto fault = [&](const char* name) {
    return (folder / name).string() + ": expected files of the plan only, got another file";
  };
  EXPECT_THAT(
      stray_files(folder.path(), plan),
      ElementsAre(fault("folder.json"), fault("job-train-00000-of-00009.json"), fault("old.h5")));
}

}  // namespace
}  // namespace eventgan
