#include "pipeline/dataset/finalize.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "manifests/documents/commit_record.h"
#include "manifests/files/sha256.h"
#include "pipeline/dataset/dataset_description.h"
#include "tests/pipeline/dataset/converted_folder.h"
#include "tests/testing/full_disk.h"
#include "tests/testing/text_file.h"
#include "tests/testing/texts.h"

namespace eventgan {
namespace {

using ::testing::Contains;
using testing::ConvertedFolder;
using testing::ExampleShard;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::names_in;
using ::testing::Not;
using testing::parts_of;
using testing::read_file;
using ::testing::StartsWith;
using testing::texts_with;

TEST(DatasetParts, AreThePlansShardsAndAHeaderOfEachSource) {
  const ConvertedFolder folder;
  const DatasetParts parts = parts_of(folder);
  EXPECT_THAT(parts.missing, IsEmpty());
  ASSERT_EQ(parts.done.size(), 4u);
  for (int i = 0; i < 4; ++i) {
    const ShardState& shard = parts.done[static_cast<std::size_t>(i)];
    EXPECT_EQ(shard.outline.name, folder.shard(i).filename());
    EXPECT_EQ(shard.record, folder.record(i));
  }
  EXPECT_EQ(parts.headers.size(), 3u);
  EXPECT_EQ(parts.headers.at(1).name, "demo-val-00000-of-00001.h5");
  EXPECT_EQ(parts.source_of(parts.done[1].outline).split, "val");
  EXPECT_THAT(parts.amendments, IsEmpty());
}

TEST(DatasetParts, WhatIsNotDoneIsNamedWithTheReason) {
  const ConvertedFolder folder(3);
  std::filesystem::remove(folder.commit_record_file(0));
  testing::write_file(folder.shard(1), "short");
  const DatasetParts parts = parts_of(folder);
  EXPECT_EQ(parts.done.size(), 1u);
  ASSERT_EQ(parts.missing.size(), 3u);
  EXPECT_EQ(parts.missing[0].outline.name, "demo-train-00000-of-00003.h5");
  EXPECT_THAT(parts.missing[0].faults, texts_with({"not committed"}));
  EXPECT_THAT(parts.missing[1].faults, texts_with({"expected size in bytes"}));
  EXPECT_EQ(parts.missing[2].condition, ShardCondition::kMissing);
  EXPECT_THAT(parts.missing[2].faults, IsEmpty());
}

TEST(DatasetParts, AShardThatIsNotWhatThePlanSaysIsRefused) {
  const auto expect_refusal = [](void (*change)(ExampleShard&), const char* what) {
    ConvertedFolder folder;
    folder.add(1, change);
    EXPECT_THROWS(parts_of(folder), std::runtime_error, what, "demo-val-00000-of-00001.h5");
  };
  expect_refusal([](ExampleShard& shard) { shard.header.plan_hash[0] = 'f'; }, "plan hash");
  expect_refusal(
      [](ExampleShard& shard) {
        shard.header.volume.size = {8, 6};  // the same number of values
      },
      "size of volumes");
}

TEST(DatasetParts, AShardWithOtherBytesIsMissingAndIsNotOpened) {
  const ConvertedFolder folder;
  const auto size = std::filesystem::file_size(folder.shard(2));
  testing::write_file(folder.shard(2), std::string(size, 'x'));
  const DatasetParts parts = parts_of(folder);
  EXPECT_EQ(parts.done.size(), 3u);
  ASSERT_EQ(parts.missing.size(), 1u);
  EXPECT_THAT(parts.missing[0].faults,
              texts_with({{folder.shard(2).string(), "expected SHA-256"}}));
  EXPECT_EQ(parts.headers.at(2).name, "demo-train-00002-of-00003.h5");  // its source's next
}

TEST(DatasetParts, ACommitRecordWithOtherCountsThanItsShardIsNamed) {
  const ConvertedFolder folder;
  CommitRecord record = folder.record(0);
  ++record.contents.persons[0];
  testing::write_file(folder.commit_record_file(0), to_json(record));
  const DatasetParts parts = parts_of(folder);
  ASSERT_EQ(parts.missing.size(), 1u);
  EXPECT_THAT(parts.missing[0].faults, texts_with({{folder.commit_record_file(0).string(),
                                                    "expected number of persons in slot 0: "}}));
}

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

TEST(Finalize, AShardThatIsCommittedAgainMeanwhileLeavesNoDescription) {
  const ConvertedFolder folder;
  int asked = 0;
  const auto clock = [&] {
    // At the start, and for each of four shards once it has been looked at.
    if (++asked == 5) {
      CommitRecord record = folder.record(2);
      record.sha256 = std::string(64, 'b');
      folder.write_commit_record(2, record);
    }
    return std::chrono::steady_clock::now();
  };
  std::ostringstream shown;
  FinalizationOptions options;
  options.show_phase = [&](const ProgressUnit& unit, std::int64_t total) {
    return std::make_unique<Progress>(shown, ProgressStyle::kNone, nullptr, total, clock, unit);
  };
  EXPECT_THROWS(finalize(folder.path(), options), std::runtime_error,
                "got one that was committed again, in " + folder.shard(2).string());
  EXPECT_THAT(names_in(folder.path()), Not(Contains(StartsWith("dataset."))));
}

TEST(Finalize, TheNotesOnTheInputsAreKept) {
  const ConvertedFolder folder;
  for (const int number : {2, 3}) {
    CommitRecord record = folder.record(number);
    record.inputs.losses.boxes = {1, {"why " + std::to_string(number)}};
    folder.write_commit_record(number, record);
  }
  const std::string lost = "2 boxes of labels left out: why 2; why 3";
  const FinalizationReport report = finalize(folder.path(), {});
  EXPECT_EQ(report.notes, (std::vector<std::string>{"clip.mp4: 60 of 100 frames", lost}));
  EXPECT_THAT(to_text(report),
              HasSubstr("2 notes on the inputs:\n  note: " + lost + "\n  note: clip.mp4"));
  const auto json = nlohmann::json::parse(description(folder));
  EXPECT_EQ(json["sources"][0]["notes"], nlohmann::json::array());
  EXPECT_EQ(json["sources"][1]["notes"], nlohmann::json{"clip.mp4: 60 of 100 frames"});
  EXPECT_EQ(json["sources"][2]["notes"], nlohmann::json{lost});
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
  EXPECT_TRUE(report.written);  // how many there are is in dataset.json
}

TEST(Finalize, AfterACrashBetweenTheTwoFilesItPutsThemRight) {
  const ConvertedFolder folder;
  finalize(folder.path(), {});
  const std::string whole = description(folder) + view(folder);
  testing::write_file(folder.path() / "dataset.json",
                      R"({"format": "eventgan-dataset", "of": "another view"})");
  finalize(folder.path(), {});
  EXPECT_EQ(description(folder) + view(folder), whole);
  std::filesystem::remove(folder.path() / "dataset.h5");
  finalize(folder.path(), {});
  EXPECT_EQ(description(folder) + view(folder), whole);
}

FinalizationReport report_of(int missing) {
  FinalizationReport report;
  report.folder = "out";
  report.shards_planned = missing + 1;
  report.counts.shards = 1;
  report.counts.samples = 5;
  report.counts.valid = 4;
  report.missing.resize(static_cast<std::size_t>(missing));
  for (std::size_t i = 0; i < report.missing.size(); ++i) {
    report.missing[i].outline.name = std::to_string(i) + ".h5";
  }
  return report;
}

TEST(FinalizationReportText, NamesMissingAndDamagedShardsOnce) {
  std::string text = to_text(report_of(2));
  EXPECT_THAT(text, HasSubstr("0.h5: missing\n1.h5: missing\n1 of 3 shards: 5 samples, 1 of them"));
  EXPECT_THAT(text, HasSubstr("--partial"));
  FinalizationReport report = report_of(1);
  report.missing[0].condition = ShardCondition::kOtherSize;
  report.missing[0].faults = {"out/0.h5: expected size in bytes 5, got 4"};
  EXPECT_THAT(to_text(report), StartsWith("out/0.h5: expected size in bytes 5, got 4\n"));
  text = to_text(report_of(4000));
  EXPECT_THAT(text, HasSubstr("99.h5: missing\n... and 3900 more"));
  EXPECT_EQ(nlohmann::json::parse(to_json(report_of(4000)))["missing"].size(), 4000u);
}

TEST(FinalizationReportText, SaysWhatWasWritten) {
  FinalizationReport report = report_of(0);
  report.written = true;
  EXPECT_THAT(to_text(report), HasSubstr("out: dataset.json, dataset.h5\n"));
  EXPECT_THAT(to_text(report), Not(HasSubstr("PARTIAL")));
  report = report_of(1);
  report.written = true;
  EXPECT_THAT(to_text(report), HasSubstr("PARTIAL"));
}

}  // namespace
}  // namespace eventgan
