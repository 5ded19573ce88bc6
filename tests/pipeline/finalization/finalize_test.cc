#include "pipeline/folder/finalize.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "stages/files/sha256.h"
#include "tests/pipeline/finalization/converted_folder.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/text_file.h"

namespace eventgan {
namespace {

using ::testing::Contains;
using testing::ConvertedFolder;
using ::testing::HasSubstr;
using testing::names_in;
using ::testing::Not;
using testing::read_file;

std::string description(const ConvertedFolder& folder) {
  return read_file(folder.path() / "dataset.json");
}
std::string view(const ConvertedFolder& folder) { return read_file(folder.path() / "dataset.h5"); }

TEST(Finalize, ACompleteFolder) {
  const ConvertedFolder folder;
  const auto before = names_in(folder.path());
  const FinalizationReport report = finalize(folder.path(), {});
  EXPECT_TRUE(report.complete());
  EXPECT_TRUE(report.written);
  EXPECT_FALSE(report.too_many_faults);
  EXPECT_EQ(report.counts.samples, 16);
  EXPECT_EQ(report.views, 1);
  EXPECT_EQ(names_in(folder.path()).size(), before.size() + 2);
  EXPECT_EQ(nlohmann::json::parse(description(folder))["view"]["sha256"], sha256_hex(view(folder)));
}

TEST(Finalize, TheNotesOnTheInputsAreKept) {
  const ConvertedFolder folder;
  const FinalizationReport report = finalize(folder.path(), {});
  EXPECT_EQ(report.notes, std::vector<std::string>{"clip.mp4: 60 of 100 frames"});
  EXPECT_THAT(to_text(report), HasSubstr("1 note on the inputs:\n  note: clip.mp4: 60 of 100"));
  const auto json = nlohmann::json::parse(description(folder));
  EXPECT_EQ(json["sources"][0]["notes"], nlohmann::json::array());
  EXPECT_EQ(json["sources"][1]["notes"], nlohmann::json{"clip.mp4: 60 of 100 frames"});
}

TEST(Finalize, TheSameBytesHoweverOftenAndWhereverTheFolderIs) {
  const ConvertedFolder folder;
  finalize(folder.path(), {});
  const std::string first = description(folder) + view(folder);
  finalize(folder.path(), {});
  EXPECT_EQ(description(folder) + view(folder), first);
  const ConvertedFolder other;
  finalize(other.path(), {});
  EXPECT_EQ(description(other) + view(other), first);
}

TEST(Finalize, AnIncompleteFolderIsLeftAlone) {
  const ConvertedFolder folder(2);
  const auto before = names_in(folder.path());
  const FinalizationReport report = finalize(folder.path(), {});
  EXPECT_FALSE(report.complete());
  EXPECT_FALSE(report.written);
  EXPECT_EQ(report.missing.size(), 2u);
  EXPECT_EQ(names_in(folder.path()), before);
}

TEST(Finalize, PartOfADatasetIfAsked) {
  ConvertedFolder folder(2);
  EXPECT_TRUE(finalize(folder.path(), {true, {}}).written);
  const auto json = nlohmann::json::parse(description(folder));
  EXPECT_EQ(json["complete"], false);
  EXPECT_EQ(json["missing"],
            (nlohmann::json{"demo-train-00001-of-00003.h5", "demo-train-00002-of-00003.h5"}));
  EXPECT_EQ(json["counts"]["total"]["samples"], 10);

  folder.add(2);
  folder.add(3);
  finalize(folder.path(), {});
  const ConvertedFolder whole;
  finalize(whole.path(), {});
  EXPECT_EQ(description(folder), description(whole));
  EXPECT_EQ(view(folder), view(whole));
}

TEST(Finalize, WithoutAnyShardThereIsNothingToWrite) {
  const ConvertedFolder folder(0);
  EXPECT_FALSE(finalize(folder.path(), {true, {}}).written);
  EXPECT_THAT(names_in(folder.path()), Not(Contains("dataset.json")));
}

TEST(Finalize, TellsIfTheLimitsArePassed) {
  const ConvertedFolder folder;  // 3 of 16 in quarantine, which is what the manifest allows
  EXPECT_FALSE(finalize(folder.path(), {}).too_many_faults);
  const FinalizationReport report =
      finalize(folder.path(), {false, ErrorSpec{ErrorPolicy::kQuarantine, 2, 0.5}});
  EXPECT_TRUE(report.too_many_faults);
  EXPECT_TRUE(report.written);  // how many there are stands in dataset.json
}

TEST(Finalize, AfterACrashBetweenTheTwoFilesItPutsThemRight) {
  const ConvertedFolder folder;
  finalize(folder.path(), {});
  const std::string whole = description(folder) + view(folder);
  testing::write_file(folder.path() / "dataset.json", "of another view");
  finalize(folder.path(), {});
  EXPECT_EQ(description(folder) + view(folder), whole);
  std::filesystem::remove(folder.path() / "dataset.h5");
  finalize(folder.path(), {});
  EXPECT_EQ(description(folder) + view(folder), whole);
}

}  // namespace
}  // namespace eventgan
